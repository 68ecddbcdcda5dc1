#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Datagrams: requests that run once, retransmission, leases, limits."""

import asyncio
import socket
import unittest

import cles
from support import AsyncTest


class Sender:
    """A socket that sends and receives datagrams as they are."""

    def __init__(self, url=None):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.socket.bind(("127.0.0.1", 0))
        if url:
            host, _, port = url.removeprefix("udp://").rpartition(":")
            self.socket.connect((host, int(port)))

    @property
    def url(self):
        return "udp://127.0.0.1:%d" % self.socket.getsockname()[1]

    def send(self, text):
        self.socket.send(text if isinstance(text, bytes) else text.encode())

    async def receive(self, seconds=5.0):
        return (await asyncio.wait_for(asyncio.get_running_loop().sock_recv(self.socket, 65536), seconds)).decode()

    async def receive_from(self):
        data, address = await asyncio.wait_for(asyncio.get_running_loop().sock_recvfrom(self.socket, 65536), 5)
        return data.decode(), address

    async def ask(self, text):
        self.send(text)
        return await self.receive()

    async def nothing(self):
        try:
            raise AssertionError(await self.receive(0.1))
        except TimeoutError:
            pass


class Served(AsyncTest):
    async def asyncSetUp(self):
        self.car = cles.Node("car1", listen=["udp://127.0.0.1:0"])
        await self.enterAsyncContext(self.car)
        self.sender = Sender(self.car.endpoints[0])
        self.addCleanup(self.sender.socket.close)
        self.runs = []

        @self.car.on_push("count")
        def count(request, body):
            self.runs.append(body)
            return len(self.runs)

        @self.car.on_delegate("work")
        async def work():
            self.runs.append("work")
            await asyncio.sleep(30)

    async def test_a_copy_does_not_run_again(self):
        first = await self.sender.ask('PUSH car1:count id=7 {"a":1}')
        self.assertEqual(first, 'id=7 {"value":1}\n')
        self.assertEqual(await self.sender.ask('PUSH car1:count id=7 {"a":1}\n'), first)
        self.assertEqual(await self.sender.ask('PUSH car1:count id=7 {"a":2}'), 'id=7 {"value":2}\n')  # it has ended
        self.assertEqual(self.runs, [{"a": 1}, {"a": 2}])
        self.sender.send("DELEGATE car1:work id=8")
        self.sender.send("DELEGATE car1:work id=8")
        await self.sender.nothing()
        self.assertEqual(self.runs[2:], ["work"])
        self.assertIn("in flight with another", await self.sender.ask("DELEGATE car1:work/x id=8"))
        self.sender.send("PUSH self:cles/cancel/8 id=9")
        replies = sorted([await self.sender.receive(), await self.sender.receive()])
        self.assertEqual(replies[1], "id=9 {}\n")
        self.assertIn('id=8 {"error":"cancelled"', replies[0])

    async def test_what_is_published_last_arrives_before_the_node_is_closed(self):
        self.car.offer("speed")
        self.assertEqual(await self.sender.ask("BIND car1:speed id=1 lease=10000"), "id=1 {}\n")
        self.car.publish("speed", "offline")
        await self.car.close()
        self.assertIn('{"value":"offline"}', await self.sender.receive())

    async def test_what_is_remembered_is_limited(self):
        self.car.limits.remembered = 4000
        for n in range(1, 4):
            await self.sender.ask(f"PUSH car1:count id={n} {{}}")
        while '"busy"' not in (reply := await self.sender.ask(f"PUSH car1:count id={n} {{}}")):
            n += 1
        self.assertIn('"retry_ms":1000', reply)
        self.assertIn('"node":"car1"', await self.sender.ask("PULL car1:cles id=100"))

    async def test_lines_that_are_wrong(self):
        self.assertIn("needs an 'id'", await self.sender.ask("PUSH car1:count {}"))
        self.assertIn("one line", await self.sender.ask("PULL car1:cles id=3\nPULL car1:cles id=4\n"))
        self.assertIn("one line", await self.sender.ask("PULL car1:cles id=3\n\n"))
        self.assertTrue((await self.sender.ask("PUSH car1:count id=5 " + "x" * 1200)).startswith('id=5 {"error":"too_large"'))
        for silent in ("", "\n", "GET / HTTP/1.1", "GET / HTTP/1.1\r\nHost: x\r\n\r\n", b"\x81sealed", "id=4 {}"):
            self.sender.send(silent)
        await self.sender.nothing()
        self.assertEqual(self.runs, [])

    async def test_replies_that_are_too_long(self):
        self.car.on_pull("text")(lambda request: "x" * int(request.parameters[0]))
        self.assertEqual(len(await self.sender.ask("PULL car1:text/1180")), 1193)
        reply = await self.sender.ask("PULL car1:text/1200 id=4")
        self.assertIn('"error":"too_large"', reply)
        self.assertIn('"ran":true', reply)

    async def test_many_tasks_do_not_fit_into_the_description(self):
        for n in range(100):
            self.car.on_pull(f"task_{n}", description="which is described at some length")(lambda: None)
        reply = await self.sender.ask("PULL car1:cles id=9007199254740991")
        self.assertLessEqual(len(reply), 1200)
        self.assertIn('"tasks":null', reply)

    async def test_leases(self):
        self.car.offer("speed")
        self.assertEqual(await self.sender.ask("BIND car1:speed id=1 lease=80"), "id=1 {}\n")
        self.car.publish("speed", 1)
        self.assertRegex(await self.sender.receive(), r"^UPDATE car1:speed seq=1 epoch=[0-9a-f]{8} {\"value\":1}\n$")
        self.car.publish("speed", "x" * 1200)  # too long: it shows as a gap
        await asyncio.sleep(0.12)
        self.car.publish("speed", 3)
        await self.sender.nothing()
        self.assertFalse(self.car.core.topics.find("speed").bindings)


class Asked(AsyncTest):
    async def test_a_request_is_sent_again_until_it_is_answered(self):
        node = Sender()
        self.addCleanup(node.socket.close)
        async with cles.connect(node.url) as client:
            asked = asyncio.create_task(client.push("car1:count", {"a": 1}))
            first, _ = await node.receive_from()
            again, address = await node.receive_from()
            self.assertEqual(first, again)
            id = int(first.split("id=")[1].split(" ")[0])
            self.assertGreater(id, 1)
            node.socket.sendto(b"id=%d {}\n" % id, address)
            self.assertEqual(await asked, {})
            delegated = asyncio.create_task(client.delegate("car1:work"))
            await node.receive_from()
            delegated.cancel()
            cancel, _ = await node.receive_from()
            self.assertEqual(cancel.split(" id=")[0], f"PUSH self:cles/cancel/{id + 1}")
            with self.assertRaisesRegex(cles.Error, "use TCP"):
                await client.push("car1:count", "x" * 1200)

    async def test_feeds_renew_their_lease_and_notice_that_it_has_ended(self):
        limits = cles.Limits(lease=0.3)
        told = []
        async with cles.Node("car1", listen=["udp://127.0.0.1:0"]) as car:
            car.offer("speed")
            async with cles.connect(car.endpoints[0], limits=limits) as client, \
                    client.bind("car1:speed", lost=told.append) as feed:
                await asyncio.sleep(0.5)
                car.publish("speed", 1)
                self.assertEqual((await anext(feed)).value, 1)
                self.assertTrue(feed.is_bound)
                await car.close()
                await self.until(lambda: told)
                self.assertEqual(told, ["the publisher did not renew the lease in time"])


if __name__ == "__main__":
    unittest.main()
