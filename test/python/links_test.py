#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""How links begin and end, what is limited, and how a node that hangs is noticed."""

import asyncio
import os
import socket
import stat
import unittest

import cles
from cles.links import StreamLink
from support import PATIENCE, AsyncTest


async def answer(reader, writer, replies):
    """Answers each request line with what `replies` returns."""
    try:
        while line := await reader.readline():
            reply = replies(line.decode()) if b" id=" in line else ""
            if reply is None:
                break
            writer.write(reply.encode())
    except ConnectionError:
        pass
    finally:
        writer.close()


class Scripted(AsyncTest):
    async def node(self, replies):
        """A node that answers as the test says; returns its URL."""
        server = await asyncio.start_server(lambda r, w: answer(r, w, replies), "127.0.0.1", 0)
        self.addCleanup(server.close)
        return "tcp://127.0.0.1:%d" % server.sockets[0].getsockname()[1]

    async def fails(self, code, work):
        with self.assertRaises(cles.Error) as caught:
            await work
        self.assertEqual(caught.exception.code, code, caught.exception)
        return caught.exception


class Ends(Scripted):
    async def asyncSetUp(self):
        self.limits = cles.Limits(line=1000, probe=0.05, discard=0.2, links=4)
        self.car = cles.Node("car1", listen=["tcp://127.0.0.1:0"], limits=self.limits)
        self.car.on_pull("speed")(lambda: 27.5)
        self.car.offer("place")
        self.stopped = asyncio.Event()

        @self.car.on_delegate("work")
        async def work(request):
            try:
                await asyncio.sleep(float(request.parameters[0]))
            except asyncio.CancelledError:
                self.stopped.set()
                raise
            return "done"

        await self.enterAsyncContext(self.car)

    async def test_a_half_closed_link_is_answered(self):
        raw = await self.raw(self.car.endpoints[0])
        raw.send("DELEGATE car1:work/0.05", "PULL car1:speed", "DELEGATE car1:work/9 id=7")
        raw.writer.write_eof()
        rest = await raw.rest()
        self.assertEqual(rest.replace("\n\n", "\n").splitlines(),
                         [rest.splitlines()[0], '{"value":"done"}', '{"value":27.5}'])
        self.assertTrue(rest.startswith('id=7 {"error":"cancelled"'))
        self.assertTrue(self.stopped.is_set())

    async def test_a_line_without_its_end_is_not_executed(self):
        raw = await self.raw(self.car.endpoints[0])
        raw.writer.write(b"PULL car1:speed id=3")
        raw.writer.write_eof()
        self.assertTrue((await raw.rest()).startswith('id=3 {"error":"bad_request"'))

    async def test_bindings_of_a_half_closed_link_live_until_the_peer_is_gone(self):
        raw = await self.raw(self.car.endpoints[0])
        self.assertEqual(await raw.ask("BIND car1:place"), "{}")
        raw.writer.write_eof()
        await asyncio.sleep(0.15)
        self.car.publish("place", 1)
        self.assertEqual(await raw.line(), "")  # a probe
        line = await raw.line()
        while not line:
            line = await raw.line()
        self.assertIn('seq=1', line)
        raw.writer.transport.abort()
        await self.until(lambda: not self.car.core.topics.find("place").bindings)

    async def test_a_line_over_the_limit(self):
        raw = await self.raw(self.car.endpoints[0])
        raw.send("PUSH car1:x id=4 " + "x" * 2000, "PULL car1:speed")
        rest = await raw.rest()
        self.assertTrue(rest.startswith('id=4 {"error":"too_large"'), rest)
        self.assertEqual(rest.count("\n"), 1)

    async def test_web_pages(self):
        raw = await self.raw(self.car.endpoints[0])
        raw.send("POST / HTTP/1.1", "Host: localhost", "", "PULL car1:speed")
        try:
            self.assertEqual(await raw.rest(), "")
        except ConnectionResetError:
            pass

    async def test_without_id_one_after_another(self):
        raw = await self.raw(self.car.endpoints[0])
        raw.send("DELEGATE car1:work/0.05", "PULL car1:speed", "PULL car1:speed id=1")
        self.assertEqual([await raw.line() for _ in range(3)], ['id=1 {"value":27.5}', '{"value":"done"}', '{"value":27.5}'])

    async def test_who_has_said_nothing_gives_way(self):
        silent = [await self.raw(self.car.endpoints[0]) for _ in range(4)]
        await self.until(lambda: len(self.car._accepted) == 4)
        for link in self.car._accepted:
            link.began -= 2_000_000_000
        other = await self.raw(self.car.endpoints[0])
        self.assertEqual(await other.ask("PULL car1:speed"), '{"value":27.5}')
        self.assertIn('"error":"busy"', await asyncio.wait_for(silent[0].rest(), 5))

    async def test_a_refused_link_is_busy(self):
        raws = [await self.raw(self.car.endpoints[0]) for _ in range(4)]
        for raw in raws:
            await raw.ask("PULL car1:speed")
        async with cles.connect(self.car.endpoints[0]) as client:
            self.assertEqual((await self.fails("busy", client.pull("car1:speed"))).retry_ms, 1000)

    async def test_replies_that_nobody_reads_stop_the_reading(self):
        self.car.limits.line = 1 << 20
        self.car.on_pull("long")(lambda: "x" * 200_000)
        raw = await self.raw(self.car.endpoints[0])
        raw.send(*["PULL car1:long"] * 200)
        await self.until(lambda: self.car.core.requests["PULL"] > 2)
        await asyncio.sleep(0.3)
        served = self.car.core.requests["PULL"]
        self.assertLess(served, 200)
        for _ in range(200):
            self.assertEqual(len(await raw.line()), 200_012)


class Peers(Scripted):
    async def test_a_node_that_leaves_has_not_started_what_it_did_not_answer(self):
        url = await self.node(lambda line: "PUSH self:cles/leaving reply=no\n")
        async with cles.Node(peers={"car1": url}) as client:
            self.assertEqual((await self.fails("busy", client.pull("car1:speed"))).retry_ms, 1000)

    async def test_a_link_that_ends(self):
        url = await self.node(lambda line: None)
        async with cles.Node(peers={"car1": url}) as client:
            await self.fails("unavailable", client.pull("car1:speed"))

    async def test_a_node_that_hangs(self):
        asked = []

        def replies(line):
            asked.append(line.split(" ")[1])
            return 'id=%s {"features":[]}\n' % line.split("id=")[1].split(" ")[0] if len(asked) == 1 else ""

        url = await self.node(replies)
        async with cles.Node(peers={"car1": url}, limits=cles.Limits(silence=0.3)) as client:
            await client.pull("self:cles", at="car1", deadline=PATIENCE)  # it is known as a node from now on
            error = await self.fails("unavailable", client.pull("car1:speed", deadline=PATIENCE))
            self.assertIn("silent", error.message)
        # A node that was itself delayed asks once more.
        self.assertEqual((asked[:3], set(asked[2:])), (["self:cles", "car1:speed", "self:cles"], {"self:cles"}))

    async def test_what_the_node_there_reads(self):
        url = await self.node(lambda line: 'id=%s {"features":["mark"],"limits":{"line":300}}\n'
                              % line.split("id=")[1].split(" ")[0].strip())
        async with cles.Node(peers={"car1": url}) as client:
            await client.pull("self:cles", at="car1")
            await client.push("car1:x", "x" * 200)
            self.assertIn("300 bytes", (await self.fails("too_large", client.push("car1:x", "x" * 300))).message)

    async def test_a_reply_that_is_too_long(self):
        url = await self.node(lambda line: 'id=1 {"value":"%s"}\n' % ("x" * 2000))
        async with cles.Node(peers={"car1": url}, limits=cles.Limits(line=1000)) as client:
            self.assertTrue((await self.fails("too_large", client.pull("car1:text"))).ran)


class Admitted(Scripted):
    """Lines before a link is open, with somebody who admits after the line `welcome`."""

    class Admission:
        name, peer_epoch, longest_line = "car1", "5f3a09c1", 20

        def __init__(self):
            self.lines, self.admitted, self.refused = [], False, ""

        def begin(self, transport):
            return ""

        def on_line(self, line):
            self.lines.append(line)
            self.admitted = line == "welcome"
            return ""

    async def open(self, *parts):
        async def serve(reader, writer):
            for part in parts:
                writer.write(part)
                await writer.drain()
                await asyncio.sleep(0.02)
            await reader.readline()
            writer.close()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        self.addCleanup(server.close)
        node = await self.enterAsyncContext(cles.Node())
        link = StreamLink(node, "tcp", accepted=False, admission=self.Admission())
        await node.loop.create_connection(lambda: link, *server.sockets[0].getsockname())
        await link.opened
        return link

    async def test_what_follows_is_read_however_it_arrives(self):
        update = b'UPDATE car1:text seq=1 epoch=5f3a09c1 {"x":"' + b"x" * 5000 + b'"}\n'
        for parts in ([b"hello\nwelcome\n" + update], [b"hello\nwel", b"come\n", update], [b"hello\nwelcome\n" + update[:9], update[9:]]):
            link = await self.open(*parts)
            await self.until(lambda: link.session.core.counts.get("updates_dropped"))  # nobody has bound it

    async def test_a_long_line(self):
        for parts in ([b"x" * 21], [b"hello\n" + b"x" * 21 + b"\nwelcome\n"], [b"x" * 30 + b"\n"]):
            await self.fails("unavailable", self.open(*parts))


class UnixSockets(AsyncTest):
    async def test_the_file(self):
        path = f"{self.scratch}/car1.sock"
        async with cles.Node("car1", listen=[f"unix://{path}"]) as car:
            self.assertEqual(stat.S_IMODE(os.stat(path).st_mode), 0o600)
            car.on_pull("who")(lambda request: [request.peer.transport, request.peer.uid])
            async with cles.connect(f"unix://{path}") as client:
                self.assertEqual(await client.pull("car1:who"), ["unix", os.getuid()])
            with self.assertRaises(OSError):  # somebody listens there
                async with cles.Node("car2", listen=[f"unix://{path}"]):
                    pass
            self.assertTrue(os.path.exists(path))
        self.assertFalse(os.path.exists(path))

    async def test_what_a_killed_process_has_left(self):
        path = f"{self.scratch}/car1.sock"
        with socket.socket(socket.AF_UNIX) as left:
            left.bind(path)
        async with cles.Node("car1", listen=[f"unix://{path}"]), cles.connect(f"unix://{path}") as client:
            self.assertEqual((await client.pull("self:cles"))["node"], "car1")

    async def test_a_peer_that_has_closed_is_gone_at_once(self):
        path = f"{self.scratch}/car1.sock"
        async with cles.Node("car1", listen=[f"unix://{path}"]) as car:
            car.offer("place")
            raw = await self.raw(f"unix://{path}")
            await raw.ask("BIND car1:place")
            raw.writer.close()
            await self.until(lambda: not car._accepted)
            self.assertFalse(car.core.topics.find("place").bindings if car.core.topics.find("place") else {})


if __name__ == "__main__":
    unittest.main()
