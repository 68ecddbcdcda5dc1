#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The Python package and the C++ programs, in both directions: `cles serve` asked from Python, a Python node asked by `cles`."""

import asyncio
import json
import unittest

import cles
from support import CLES, AsyncTest, start
from support import cles as command


class Asked(AsyncTest):
    """A node of `cles serve`."""

    async def asyncSetUp(self):
        urls = ["tcp://127.0.0.1:0", "udp://127.0.0.1:0", f"unix://{self.scratch}/car1.sock"]
        process, first = start(self, CLES, "serve", "--name", "car1", *(word for url in urls for word in ("--listen", url)))
        lines = [first, process.stdout.readline().strip(), process.stdout.readline().strip()]
        self.urls = [line.split(" ")[-1] for line in lines]

    async def test_every_verb_on_every_transport(self):
        for url in self.urls:
            with self.subTest(url):
                async with cles.connect(url) as node:
                    self.assertEqual(set(await node.pull("car1:localization")),
                                     {"utc", "lat", "lon", "velocity", "acceleration"})
                    self.assertEqual(await node.push("car1:echo", {"a": [1, "ä", None]}), {"a": [1, "ä", None]})
                    told = []
                    done = await node.delegate("car1:sleep/50", progress=lambda fraction, _: told.append(fraction))
                    self.assertEqual(done, {"slept_ms": 50})
                    self.assertTrue(told and told == sorted(told))
                    with self.assertRaises(cles.Error) as caught:
                        await node.delegate("car1:sleep/9000", deadline=0.05)
                    self.assertEqual(caught.exception.code, "deadline")
                    async with node.bind("car1:localization", every=0.05) as feed:
                        seen = [await anext(feed) for _ in range(3)]
                    self.assertEqual({update.publisher for update in seen}, {"car1"})
                    self.assertLess(seen[1].seq, seen[2].seq)

    async def test_many_at_once(self):
        async with cles.connect(self.urls[0]) as node:
            got = await asyncio.gather(*(node.push("car1:echo", {"n": n}, deadline=20) for n in range(1000)))
            self.assertEqual(got, [{"n": n} for n in range(1000)])

    async def test_cancelled_work_ends_there(self):
        async with cles.connect(self.urls[0]) as node:
            task = asyncio.create_task(node.delegate("car1:sleep/20000"))
            while (await node.pull("car1:cles/metrics"))["handlers_running"] == 0:
                await asyncio.sleep(0.01)
            task.cancel()
            while (await node.pull("car1:cles/metrics"))["handlers_running"] != 0:
                await asyncio.sleep(0.01)


class Served(AsyncTest):
    """A node of the package, asked by `cles`."""

    async def asyncSetUp(self):
        self.cam = cles.Node("cam1", listen=["tcp://127.0.0.1:0", "udp://127.0.0.1:0", f"unix://{self.scratch}/cam1.sock"])
        self.cam.on_pull("text", description="A text of n characters", parameters=["n"])(
            lambda request: "x" * int(request.parameters[0]))
        self.cam.on_push("echo")(lambda request, body: body)

        @self.cam.on_delegate("work")
        async def work(request):
            for step in range(3):
                request.progress(step / 3)
                await asyncio.sleep(0.01)
            return {"done": True}

        self.cam.offer("tick")
        await self.enterAsyncContext(self.cam)

    async def ask(self, *words, at=0):
        code, out, err = await command(*words, "--at", self.cam.endpoints[at], "-o", "json")
        self.assertEqual(code, 0, err)
        return out.strip()

    async def test_every_verb_on_every_transport(self):
        for at in range(3):
            self.assertEqual(await self.ask("pull", "cam1:text/3", at=at), '{"value":"xxx"}')
            self.assertEqual(json.loads(await self.ask("push", "cam1:echo", "-d", '{"a":[1]}', at=at)), {"a": [1]})
            self.assertEqual(json.loads(await self.ask("delegate", "cam1:work", at=at)), {"done": True})

    async def test_it_describes_itself(self):
        told = json.loads(await self.ask("info", "cam1"))
        self.assertEqual((told["node"], told["protocol"]), ("cam1", 1))
        self.assertIn({"verb": "PULL", "task": "text", "description": "A text of n characters", "parameters": ["n"],
                       "idempotent": True}, told["tasks"])

    async def test_a_feed(self):
        async def publish():
            number = 0
            while True:
                number += 1
                self.cam.publish("tick", {"n": number})
                await asyncio.sleep(0.02)

        publishing = asyncio.create_task(publish())
        lines = (await self.ask("bind", "cam1:tick", "-n", "4")).splitlines()
        publishing.cancel()
        numbers = [json.loads(line)["n"] for line in lines]
        self.assertEqual(len(numbers), 4)
        self.assertEqual(numbers[1:], list(range(numbers[1], numbers[1] + 3)))

    async def test_errors(self):
        code, _, err = await command("pull", "cam1:nothing", "--at", self.cam.endpoints[0])
        self.assertEqual((code, err.splitlines()[0]), (3, "cles: no_task: cam1 has no PULL 'nothing'"))


if __name__ == "__main__":
    unittest.main()
