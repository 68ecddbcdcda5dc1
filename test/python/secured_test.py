#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A secured fleet: `tls://` with the node's key, rosters, rights, and a Python node behind a local daemon."""

import asyncio
import json
import shutil
import unittest

import cles
from support import CLES, CLESD, PATIENCE, AsyncTest, start
from support import cles as command


class Secured(AsyncTest):
    async def good(self, *words):
        code, out, err = await command(*words)
        self.assertEqual(code, 0, (words, err))
        return out.strip()

    async def asyncSetUp(self):
        self.fleet = self.scratch / "fleet"
        await self.good("fleet", "init", str(self.fleet), "--with", "car1,cam1,op")
        for name in ("cam1", "op"):
            await self.good("keys", "cert", "--keys", str(self.fleet / name))

    def keys(self, name):
        return str(self.fleet / name)

    async def new_roster(self, *names):
        for name in names:
            await self.good("keys", "join", str(self.fleet / "roster"), "--keys", self.keys(name))

    async def fails(self, code, work, says=""):
        with self.assertRaisesRegex(cles.Error, says) as caught:
            await work
        self.assertEqual(caught.exception.code, code, caught.exception)


class Streams(Secured):
    async def asyncSetUp(self):
        await super().asyncSetUp()
        _, line = start(self, CLES, "serve", "--keys", self.keys("car1"), "--listen", "tls://127.0.0.1:0")
        self.url = line.split(" ")[-1]

    async def test_requests_and_feeds(self):
        async with cles.Node(peers={"car1": self.url}, keys=self.keys("cam1")) as cam:
            self.assertEqual(cam.name, "cam1")
            self.assertEqual(await cam.push("car1:echo", {"x": "y" * 100_000}), {"x": "y" * 100_000})
            async with cam.bind("car1:localization", every=0.05) as feed:
                seen = [await anext(feed) for _ in range(3)]
            self.assertLess(seen[1].seq, seen[2].seq)
            got = await asyncio.gather(*(cam.push("car1:echo", {"n": n}, deadline=20) for n in range(200)))
            self.assertEqual(got, [{"n": n} for n in range(200)])

    async def test_the_name_is_that_of_the_key(self):
        with self.assertRaisesRegex(cles.RefusedError, "is that of 'cam1'"):
            cles.Node("other", keys=self.keys("cam1"))
        async with cles.Node(peers={"car2": self.url}, keys=self.keys("cam1")) as cam:
            await self.fails("unavailable", cam.pull("car2:cles"), "the other end is car1, not car2")
        async with cles.connect(self.url, keys=self.keys("op")) as op:
            self.assertEqual((await op.pull("self:cles"))["node"], "car1")

    async def test_a_stranger_and_a_member_that_was_removed(self):
        await self.good("fleet", "init", str(self.scratch / "other"), "--with", "cam1")
        await self.good("keys", "cert", "--keys", str(self.scratch / "other/cam1"))
        async with cles.connect(self.url, keys=self.scratch / "other/cam1") as stranger:
            await self.fails("unavailable", stranger.pull("self:cles"), "key is not in roster|refused the link")
        async with cles.connect(self.url, keys=self.keys("cam1")) as cam:
            await cam.pull("self:cles")
            await self.good("fleet", "remove", "cam1", "--keys", str(self.fleet))
            await self.new_roster("car1", "op")
            await self.until(lambda: not cam._links, "its link lives on")
            await self.fails("unavailable", cam.pull("self:cles"))
        async with cles.connect(self.url, keys=self.keys("op")) as op:
            self.assertEqual((await op.pull("self:cles"))["node"], "car1")

    async def test_the_newer_roster_arrives_with_the_link(self):
        await self.good("fleet", "rotate", "--keys", str(self.fleet))
        await self.new_roster("car1")
        async with cles.connect(self.url, keys=self.keys("cam1")) as cam:
            before = cam.fleet.version
            await cam.pull("self:cles")
            await self.until(lambda: cam.fleet.version == before + 1)
            stored = (self.fleet / "cam1" / "roster").read_text()
            self.assertEqual(stored, (self.fleet / "roster").read_text())
            await self.good("fleet", "rotate", "--keys", str(self.fleet))
            await self.new_roster("cam1")  # and from this end to the other
            await self.until(lambda: cam.fleet.version == before + 2)
            while (await cam.pull("self:cles"))["roster"] != before + 2:
                await asyncio.sleep(0.05)

    async def test_rights(self):
        await self.good("fleet", "rights", "cam1", "--may", "pull *:*/**", "--keys", str(self.fleet))
        await self.new_roster("car1", "cam1")
        async with cles.connect(self.url, keys=self.keys("cam1")) as cam:
            await cam.pull("car1:localization")
            await self.fails("denied", cam.push("car1:echo", {}))

    async def test_files_that_others_can_read_or_change(self):
        path = self.fleet / "cam1" / "tls.pem"
        path.chmod(0o644)
        with self.assertRaisesRegex(cles.RefusedError, "chmod 600"):
            cles.Node(keys=self.keys("cam1"))
        path.unlink()
        with self.assertRaisesRegex(cles.RefusedError, "'cles keys cert"):
            cles.Node(keys=self.keys("cam1"))
        shutil.copy(self.fleet / "op" / "tls.pem", path)
        path.chmod(0o600)
        self.assertEqual(cles.Node(keys=self.keys("cam1")).name, "op")  # whose key it is
        (self.fleet / "op" / "roster").chmod(0o666)
        with self.assertRaisesRegex(cles.RefusedError, "chmod go-w"):
            cles.Node(keys=self.keys("op"))

    async def test_what_needs_a_local_daemon(self):
        for url in ("tls://127.0.0.1:0", "tcp://127.0.0.1:0", "udp://127.0.0.1:0"):
            with self.assertRaisesRegex(cles.RefusedError, "clesd"):
                cles.Node(keys=self.keys("cam1"), listen=[url])
        async with cles.Node(peers={"car1": "udp://127.0.0.1:9"}, keys=self.keys("cam1")) as cam:
            with self.assertRaisesRegex(cles.RefusedError, "sealed"):
                await cam.pull("car1:cles")


class ThroughADaemon(Secured):
    """`car1` is a daemon on the host of the Python node `cam1`."""

    async def asyncSetUp(self):
        await super().asyncSetUp()
        for name in ("car1", "cam1"):
            await self.good("fleet", "rights", name, "--forwards", "*", "--keys", str(self.fleet))
        await self.new_roster("car1", "cam1", "op")
        config = self.scratch / "clesd.yaml"
        config.write_text(f"listen: [tls://127.0.0.1:0, unix://{self.scratch}/car1.sock]\nmulticast: off\n"
                          f"security: {self.keys('car1')}\npeers: {{cam1: unix://{self.scratch}/cam1.sock}}\n")
        _, line = start(self, CLESD, "--config", str(config))
        self.url = line.split(" ")[-1]

    async def test_others_reach_it_by_name(self):
        async with cles.Node(listen=[f"unix://{self.scratch}/cam1.sock"], keys=self.keys("cam1"),
                             join=[f"unix://{self.scratch}/car1.sock"]) as cam:
            cam.on_pull("who")(lambda request: [request.requester, request.forwarded_by, request.peer.name])
            cam.offer("tick")
            out = await self.good("pull", "cam1:who", "--at", self.url, "--keys", self.keys("op"), "-o", "json")
            self.assertEqual(json.loads(out), ["op", "cam1", "cam1"])
            (self.fleet / "cam1" / "rules").write_text("deny op may pull *:who\n")
            while (await command("pull", "cam1:who", "--at", self.url, "--keys", self.keys("op")))[0] == 0:
                await asyncio.sleep(0.1)
            (self.fleet / "cam1" / "rules").unlink()
            async with cles.Node(peers={"car1": self.url}, through="car1", keys=self.keys("op")) as op:
                async with op.bind("cam1:tick") as feed:
                    publishing = asyncio.create_task(self.publish(cam))
                    seen = [await anext(feed) for _ in range(3)]
                    publishing.cancel()
                self.assertEqual([update.seq for update in seen], list(range(seen[0].seq, seen[0].seq + 3)))

    @staticmethod
    async def publish(cam):
        while True:
            cam.publish("tick", 1)
            await asyncio.sleep(0.05)

    async def test_the_command_binds_what_it_passes_on(self):
        """The daemon and the command do not know cam1 by an announcement."""
        for rate, count in (((), 1), (("--rate", "50"), 3)):
            process, _ = start(self, CLES, "publish", "cam1:notice", "-d", "[7]", *rate, "--keys", self.keys("cam1"),
                               "--listen", f"unix://{self.scratch}/cam1.sock")
            for where, keys in ((self.url, ("--keys", self.keys("op"))),
                                (f"unix://{self.scratch}/car1.sock", ("--keys", self.keys("op"))),
                                (f"unix://{self.scratch}/car1.sock", ())):
                with self.subTest(where=where, keys=keys, count=count):
                    out = await self.good("bind", "cam1:notice", "-n", str(count), "--duration", "4s", "--at", where, *keys)
                    self.assertEqual(out.split("\n"), ["[7]"] * count)
            process.terminate()
            self.assertEqual(process.wait(PATIENCE), 0)

    async def test_the_command_binds_what_a_python_node_publishes(self):
        async with cles.Node(listen=[f"unix://{self.scratch}/cam1.sock"], keys=self.keys("cam1"),
                             join=[f"unix://{self.scratch}/car1.sock"]) as cam:
            cam.offer("tick")
            publishing = asyncio.create_task(self.publish(cam))
            try:
                out = await self.good("bind", "cam1:tick", "-n", "3", "--duration", "10s", "-o", "json", "--at", self.url, "--keys",
                                      self.keys("op"))
            finally:
                publishing.cancel()
            self.assertEqual(out.split("\n"), ['{"value":1}'] * 3)

    async def test_a_client_of_the_host_needs_no_key(self):
        async with cles.connect(f"unix://{self.scratch}/car1.sock") as client:
            self.assertEqual((await client.pull("self:cles"))["node"], "car1")


if __name__ == "__main__":
    unittest.main()
