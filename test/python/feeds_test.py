#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Feeds: order, gaps, restarts, a publisher that is lost and returns, slow subscribers."""

import asyncio
import socket
import unittest

import cles
from support import PATIENCE, AsyncTest


class Publisher(AsyncTest):
    async def asyncSetUp(self):
        self.car = cles.Node("car1", listen=["tcp://127.0.0.1:0"])
        self.car.offer("speed")
        await self.car.start()
        self.addAsyncCleanup(self.close_car)
        self.client = await self.enterAsyncContext(cles.connect(self.car.endpoints[0]))

    async def close_car(self):
        await self.car.close()

    async def take(self, feed, count):
        return [await anext(feed) for _ in range(count)]


class Updates(Publisher):
    async def test_the_last_value_comes_first(self):
        async with self.client.bind("car1:speed") as feed:
            for n in range(3):
                self.car.publish("speed", n)
            self.assertEqual([(u.value, u.seq, u.missed) for u in await self.take(feed, 3)], [(0, 1, 0), (1, 2, 0), (2, 3, 0)])
        async with self.client.bind("car1:speed", float) as feed:
            first = await anext(feed)
            self.assertEqual((first.value, type(first.value), first.publisher), (2.0, float, "car1"))

    async def test_parameters_belong_to_the_noun(self):
        async with self.client.bind("car1:speed/front") as front, self.client.bind("car1:speed") as speed:
            self.car.publish("speed/front", 1)
            self.car.publish("speed", 2)
            self.assertEqual([(await anext(front)).value, (await anext(speed)).value], [1, 2])
        with self.assertRaises(ValueError):
            self.car.publish("speed/", 1)

    async def test_the_end_of_a_feed_ends_the_binding(self):
        async with self.client.bind("car1:speed"):
            self.car.publish("speed", 1)
            self.assertEqual(len(self.car.core.topics.find("speed").bindings), 1)
        self.assertEqual(len(self.car.core.topics.find("speed").bindings), 0)

    async def test_two_feeds_of_one_noun(self):
        async with self.client.bind("car1:speed") as all, self.client.bind("car1:speed", every=0.05) as some:
            for n in range(4):
                self.car.publish("speed", n)
            self.assertEqual([u.value for u in await self.take(all, 4)], [0, 1, 2, 3])
            thinned = await self.take(some, 2)
            self.assertEqual([(u.value, u.missed) for u in thinned], [(0, 0), (3, 0)])
        self.assertEqual(len(self.car.core.topics.find("speed").bindings), 0)

    async def test_what_is_published_last_arrives_before_the_node_is_closed(self):
        loop = asyncio.get_running_loop()
        host, _, port = self.car.endpoints[0].removeprefix("tcp://").rpartition(":")
        with socket.socket() as slow:
            slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            slow.setblocking(False)
            await loop.sock_connect(slow, (host, int(port)))
            await loop.sock_sendall(slow, b"BIND car1:speed keep=100 id=1\n")
            await loop.sock_recv(slow, 100)
            for n in range(500):  # more than a link takes
                self.car.publish("speed", {"n": n, "text": "x" * 10_000})
            closing = asyncio.create_task(self.car.close(grace=PATIENCE))
            received = b""
            while data := await asyncio.wait_for(loop.sock_recv(slow, 65_536), PATIENCE):
                received += data
            await closing
        last, notice = received.decode().splitlines()[-2:]
        self.assertIn('{"n":499,', last[:80])
        self.assertEqual(notice, "PUSH self:cles/leaving reply=no")

    async def test_what_is_not_offered(self):
        for noun in ("car1:nothing", "car2:speed"):
            with self.assertRaises(cles.Error):
                async with self.client.bind(noun):
                    pass

        @self.car.on_bind("lane")
        async def lane(request):
            await asyncio.sleep(0)
            if request.parameters != ("left",):
                raise cles.Error("bad_request", "there is only lane/left")

        async with self.client.bind("car1:lane/left") as feed:
            self.car.publish("lane/left", {"m": 3.5})
            self.assertEqual((await anext(feed)).value, {"m": 3.5})
        with self.assertRaisesRegex(cles.Error, "there is only"):
            async with self.client.bind("car1:lane/right"):
                pass

    async def test_a_program_that_fetches_late(self):
        limits = cles.Limits(feed=3)
        async with cles.connect(self.car.endpoints[0], limits=limits) as client, client.bind("car1:speed") as feed:
            for n in range(8):
                self.car.publish("speed", n)
            await self.until(lambda: feed._queue and feed._queue[-1].seq == 8)
            self.assertEqual([(u.value, u.missed) for u in await self.take(feed, 3)], [(5, 5), (6, 0), (7, 0)])

    async def test_a_subscriber_that_reads_nothing_loses_the_oldest(self):
        raw = await self.raw(self.car.endpoints[0])
        self.assertEqual(await raw.ask("BIND car1:speed keep=2"), "{}")
        text = "x" * 100_000
        for n in range(200):  # more than the kernel and the link hold
            self.car.publish("speed", {"n": n, "text": text})
        binding = next(iter(self.car.core.topics.find("speed").bindings.values()))
        self.assertLessEqual(len(binding._queue), 2)
        numbers = []
        while not numbers or numbers[-1] != 200:
            numbers.append(int((await raw.line()).split("seq=")[1].split(" ")[0]))
        self.assertEqual(numbers, sorted(set(numbers)))
        self.assertLess(len(numbers), 200)
        self.assertEqual(numbers[-2:], [199, 200])

    async def test_updates_that_are_wrong(self):
        raw_server = await asyncio.start_server(self.serve_wrong, "127.0.0.1", 0)
        peers = {"car9": "tcp://127.0.0.1:%d" % raw_server.sockets[0].getsockname()[1]}
        async with raw_server, cles.Node(peers=peers) as client, client.bind("car9:speed", float) as feed:
            got = await self.take(feed, 3)
        self.assertEqual([(u.value, u.seq, u.missed, u.restarted) for u in got],
                         [(1.0, 17, 0, False), (4.0, 21, 2, False), (5.0, 3, 0, True)])

    @staticmethod
    async def serve_wrong(reader, writer):
        await reader.readline()
        for line in ("id=1 {}", 'UPDATE car9:speed seq=17 epoch=5f3a09c1 {"value":1}',
                     'UPDATE car9:speed seq=17 epoch=5f3a09c1 {"value":2}', 'UPDATE car9:speed seq=18 epoch=5f3a09c1 {"value":',
                     'UPDATE car9:speed seq=18 epoch=5f3a09c1 {"error":"x"}', 'UPDATE car8:speed seq=18 epoch=5f3a09c1 {"value":3}',
                     'UPDATE car9:speed seq=18 epoch=5f3a09c1 {"value":"text"}',
                     'UPDATE car9:speed seq=21 epoch=5f3a09c1 {"value":4}', 'UPDATE car9:speed seq=3 epoch=00000001 {"value":5}',
                     'UPDATE car9:speed seq=22 epoch=5f3a09c1 {"value":6}'):
            writer.write(f"{line}\n".encode())
        await reader.readline()
        writer.close()


class Losses(Publisher):
    async def test_a_publisher_that_returns(self):
        told = []
        url = self.car.endpoints[0]
        async with self.client.bind("car1:speed", lost=told.append, rebound=lambda: told.append("back")) as feed:
            self.car.publish("speed", 1)
            self.assertEqual((await anext(feed)).value, 1)
            await self.car.close()
            await self.until(lambda: told)
            self.assertFalse(feed.is_bound)
            self.car = cles.Node("car1", listen=[url])
            self.car.offer("speed")
            await self.car.start()
            await self.until(lambda: feed.is_bound and len(told) == 2)
            self.assertIn("the publisher", told[0])
            self.assertEqual(told[1], "back")
            self.car.publish("speed", 2)
            update = await anext(feed)
            self.assertEqual((update.value, update.seq, update.restarted), (2, 1, True))

    async def test_the_link_is_lost(self):
        async with self.client.bind("car1:speed") as feed:
            self.car.publish("speed", 1)
            await anext(feed)
            for link in list(self.car._accepted):
                link.close()
            await self.until(lambda: not feed.is_bound)
            self.car.publish("speed", 2)
            self.car.publish("speed", 3)
            update = await anext(feed)  # the last value at the new binding, with its number
            self.assertEqual((update.value, update.seq, update.missed), (3, 3, 1))

    async def test_who_may_be_a_person_is_not_asked_what_it_understands(self):
        async with cles.Node(peers={"car1": self.car.endpoints[0]}) as client, client.bind("car1:speed") as feed:
            self.car.publish("speed", 1)
            await anext(feed)
            for link in list(self.car._accepted):
                link.close()
            await self.until(lambda: not feed.is_bound)
            self.car.publish("speed", 2)
            self.assertEqual(self.car.core.requests["PULL"], 0)
            update = await anext(feed)
            self.assertEqual((update.value, update.seq), (2, 0))
            self.car.publish("speed", 3)
            update = await anext(feed)
            self.assertEqual((update.value, update.seq, update.missed), (3, 3, 1))
            await client.pull("car1:cles")


if __name__ == "__main__":
    unittest.main()
