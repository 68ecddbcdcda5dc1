#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Pools: `any:` and `all:` through a daemon, and a Python node as a member of the pool."""

import asyncio
import contextlib
import unittest

import cles
from support import CLESD, AsyncTest, start


class Pool(AsyncTest):
    async def asyncSetUp(self):
        _, line = start(self, CLESD, "--listen", "tcp://127.0.0.1:0", "--name", "hub")
        self.hub = line.split(" ")[-1]
        _, line = start(self, CLESD, "--listen", "tcp://127.0.0.1:0", "--name", "hub2", "--seed", self.hub)
        self.hub2 = line.split(" ")[-1]

    async def member(self, name):
        node = cles.Node(name, listen=["tcp://127.0.0.1:0"], join=[self.hub])
        node.on_pull("who")(lambda: name)
        node.offer("tick")
        await node.start()
        self.addAsyncCleanup(node.close)
        return node

    async def known(self, client, *names):
        """Waits until the node there knows these others."""
        while set(names) - {peer["node"] for peer in (await client.pull("self:cles/peers"))["peers"]
                            if peer["state"] == "live"}:
            await asyncio.sleep(0.05)

    async def test_members_are_found_through_any_node(self):
        cams = [await self.member(f"cam{number}") for number in (1, 2)]
        async with cles.connect(self.hub2) as client:
            await self.known(client, "cam1", "cam2")
            while len(found := (await client.pull("all:who"))["results"]) < 2:  # until it has asked which tasks they offer
                await asyncio.sleep(0.05)
            self.assertEqual(found, {"cam1": {"value": "cam1"}, "cam2": {"value": "cam2"}})
            self.assertEqual({await client.pull("any:who") for _ in range(30)}, {"cam1", "cam2"})
            self.assertEqual(await client.pull("cam2:who"), "cam2")
            async with client.bind("all:tick") as feed:
                for cam in cams:
                    cam.publish("tick", cam.name)
                got = {update.publisher: update.value for update in [await anext(feed), await anext(feed)]}
            self.assertEqual(got, {"cam1": "cam1", "cam2": "cam2"})
            await cams[0].close()
            while "cam1" in (await client.pull("all:who"))["results"]:
                await asyncio.sleep(0.05)

    async def test_a_python_node_asks_through_the_pool(self):
        await self.member("cam1")
        async with cles.Node("op", through=self.hub) as op:
            self.assertEqual((await op.pull("any:cles"))["protocol"], 1)
            await self.known(op, "cam1")
            self.assertEqual(await op.pull("cam1:who"), "cam1")
            with self.assertRaises(cles.Error) as caught:
                await op.pull("nobody:who")
            self.assertEqual(caught.exception.code, "no_target")

    async def test_a_publisher_behind_a_daemon_restarts(self):
        cam = await self.member("cam1")
        async with cles.connect(self.hub) as client:
            await self.known(client, "cam1")
            async with client.bind("cam1:tick") as feed:
                cam.publish("tick", 1)
                self.assertEqual((await anext(feed)).value, 1)
                await cam.close()
                cam = await self.member("cam1")
                cam.publish("tick", 2)
                update = await anext(feed)
                self.assertEqual((update.value, update.restarted), (2, True))

    async def test_a_daemon_that_takes_no_members(self):
        async with cles.Node("lonely", listen=["tcp://127.0.0.1:0"]) as other:
            with self.assertLogs("cles", "WARNING") as logged:
                async with cles.Node("cam1", listen=["tcp://127.0.0.1:0"], join=other.endpoints):
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(asyncio.Event().wait(), 0.3)
            self.assertIn("does not take this node into its pool", logged.output[0])


if __name__ == "__main__":
    unittest.main()
