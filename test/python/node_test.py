#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A node over TCP and Unix sockets: the verbs in both directions, deadlines, cancellation, progress, types, access."""

import asyncio
import unittest
from dataclasses import dataclass
from typing import Annotated

import cles
from support import AsyncTest, PATIENCE


@dataclass
class Position:
    lat: Annotated[float, cles.Field(unit="deg", minimum=-90, maximum=90)]
    lon: float = 0.0


class Served(AsyncTest):
    async def asyncSetUp(self):
        self.car = cles.Node("car1", listen=["tcp://127.0.0.1:0", f"unix://{self.scratch}/car1.sock"])
        await self.car.start()
        self.addAsyncCleanup(self.car.close)

    async def client(self, which=0):
        client = await self.enterAsyncContext(cles.connect(self.car.endpoints[which]))
        return client

    async def fails(self, code, work):
        with self.assertRaises(cles.Error) as caught:
            await work
        self.assertEqual(caught.exception.code, code, caught.exception)
        return caught.exception


class Verbs(Served):
    async def test_each_of_them(self):
        taken = []
        self.car.on_pull("speed")(lambda: 27.5)
        self.car.on_push("target")(lambda request, body: taken.append(body))
        self.car.on_delegate("plan")(lambda request, body: {"to": body, "by": list(request.parameters)})
        self.car.on_update("notice")(lambda request: None)
        for which in (0, 1):
            client = await self.client(which)
            self.assertEqual(await client.pull("car1:speed"), 27.5)
            self.assertEqual(await client.push("car1:target", [1]), {})
            self.assertEqual(await client.delegate("self:plan/a%20b", "home"), {"to": {"value": "home"}, "by": ["a b"]})
            async with client.bind("car1:notice") as feed:
                await client.update("car1:notice", {"text": "x"})
                self.assertEqual((await anext(feed)).value, {"text": "x"})
        self.assertEqual(taken, [[1], [1]])

    async def test_a_link_carries_requests_in_both_directions(self):
        self.car.on_pull("speed")(lambda: 1)
        raw = await self.raw(self.car.endpoints[0])
        self.assertEqual(await raw.ask("PULL self:speed id=3"), 'id=3 {"value":1}')
        link = next(iter(self.car._accepted))
        asked = asyncio.create_task(self.car.ask_on(link, "PULL", "self:speed"))
        self.assertRegex(await raw.line(), "^PULL self:speed id=1( deadline=[0-9]+)?$")
        raw.send('id=1 {"value":2}')
        self.assertEqual((await asked)[0], {"value": 2})

    async def test_errors_have_code_and_message(self):
        client = await self.client()

        @self.car.on_push("fail")
        def fail(request):
            raise cles.Error(request.parameters[0], "as it was asked to", retry_ms=250)

        @self.car.on_pull("broken")
        def broken():
            return open("/nowhere/secret.txt")

        error = await self.fails("busy", client.push("car1:fail/busy"))
        self.assertEqual((error.message, error.retry_ms), ("car1: as it was asked to", 250))
        self.assertTrue((await self.fails("too_large", client.push("car1:fail/too_large"))).ran)
        await self.fails("no_task", client.pull("car1:unknown"))
        await self.fails("no_target", client.pull("car9:unknown"))
        self.assertEqual((await self.fails("failed", client.pull("car1:broken"))).message, "car1: No such file or directory")
        with self.assertRaises(cles.ConversionError):
            await client.push("car1:fail/busy", object())
        with self.assertRaises(ValueError):
            await client.pull("car1 speed")

    async def test_what_cannot_be_sent(self):
        client = await self.client()
        self.car.on_pull("set")(lambda: object())
        self.car.on_pull("text")(lambda: "\ud800")
        self.car.on_pull("long")(lambda: "x" * (1 << 20))
        self.car.on_pull("numbers")(lambda: [float("nan"), float("inf"), 1.5])
        await self.fails("failed", client.pull("car1:set"))
        await self.fails("failed", client.pull("car1:text"))
        self.assertTrue((await self.fails("too_large", client.pull("car1:long", deadline=PATIENCE))).ran)
        self.assertEqual(await client.pull("car1:numbers"), [None, None, 1.5])
        await self.fails("too_large", client.push("car1:set", "x" * (1 << 20)))

    async def test_many_at_once(self):
        @self.car.on_pull("later")
        async def later(request):
            await asyncio.sleep(0.001 * (10 - int(request.parameters[0]) % 10))
            return int(request.parameters[0])

        client = await self.client()
        got = await asyncio.gather(*(client.pull(f"car1:later/{n}", deadline=PATIENCE) for n in range(500)))
        self.assertEqual(got, list(range(500)))

    async def test_types_of_bodies_and_results(self):
        @self.car.on_push("target")
        def target(where: Position) -> Position:
            return Position(-where.lat, where.lon)

        @self.car.on_pull("count")
        def count() -> int:
            return 3

        client = await self.client()
        self.assertEqual(await client.push("car1:target", Position(48.1, 11.5), type=Position), Position(-48.1, 11.5))
        self.assertEqual(await client.pull("car1:count", int), 3)
        error = await self.fails("bad_request", client.push("car1:target", {"lat": "x"}))
        self.assertEqual(error.message, "car1: lat: expected a number, got a string")
        await self.fails("bad_request", client.push("car1:target", {"lat": 91}))
        with self.assertRaises(cles.ConversionError):
            await client.push("car1:target", Position(91))
        told = await client.pull("car1:cles/types/target")
        self.assertEqual(told["PUSH"]["body"]["$ref"], "#/$defs/Position")
        self.assertEqual(told["PUSH"]["body"]["$defs"]["Position"]["properties"]["lat"],
                         {"type": ["number", "null"], "unit": "deg", "minimum": -90, "maximum": 90})
        described = await client.pull("self:cles")
        self.assertIn({"verb": "PULL", "task": "count", "idempotent": True}, described["tasks"])
        self.assertEqual(len(described["types"]), 16)

    async def test_a_function_that_cannot_be_a_handler(self):
        with self.assertRaises(TypeError):
            self.car.on_pull("x")(lambda request, body: None)
        with self.assertRaises(TypeError):
            self.car.on_push("x")(lambda a, b, c: None)
        self.car.on_push("x")(lambda: None)
        with self.assertRaises(ValueError):
            self.car.on_push("x")(lambda: None)
        with self.assertRaises(ValueError):
            self.car.on_push("cles")(lambda: None)


class Time(Served):
    async def test_deadline_and_cancellation_stop_the_handler(self):
        stopped = asyncio.Queue()

        @self.car.on_delegate("work")
        async def work(request):
            try:
                await asyncio.sleep(PATIENCE)
            except asyncio.CancelledError:
                stopped.put_nowait(request.parameters[0])
                raise

        client = await self.client()
        await self.fails("deadline", client.delegate("car1:work/deadline", deadline=0.05))
        self.assertEqual(await stopped.get(), "deadline")
        task = asyncio.create_task(client.delegate("car1:work/cancelled"))
        await self.until(lambda: self.car.core.running)
        task.cancel()
        with self.assertRaises(asyncio.CancelledError):
            await task
        self.assertEqual(await stopped.get(), "cancelled")
        task = asyncio.create_task(client.delegate("car1:work/lost"))
        await self.until(lambda: self.car.core.running)
        next(iter(client._links.values())).close()
        await self.fails("unavailable", task)
        self.assertEqual(await stopped.get(), "lost")
        self.assertEqual((self.car.core.running, self.car.core.budget.used), (0, 0))

    async def test_the_time_that_is_left(self):
        self.car.on_pull("left")(lambda request: request.seconds_left)
        client = await self.client()
        self.assertTrue(59 < await client.pull("car1:left", deadline=60) <= 60)
        self.assertTrue(4 < await client.pull("car1:left") <= 5)

    async def test_progress(self):
        @self.car.on_delegate("work")
        async def work(request):
            wanted = [request.progress(0.5, {"at": "x"}), request.progress(0.2)]
            return wanted

        client = await self.client()
        told = []
        self.assertEqual(await client.delegate("car1:work", progress=lambda *each: told.append(each)), [True, True])
        self.assertEqual(told, [(0.5, {"at": "x"}), (0.5, {})])
        self.assertEqual(await client.delegate("car1:work"), [False, False])

    async def test_what_the_program_raises_while_lines_are_read_ends_nothing(self):
        def wrong(*_):
            raise RuntimeError("a mistake of the program")

        @self.car.on_delegate("work")
        async def work(request):
            request.progress(0.5)
            return "done"

        client = await self.client()
        with self.assertLogs("cles", "ERROR"):
            self.assertEqual(await client.delegate("car1:work", progress=wrong), "done")
        async with cles.Node("strict", listen=[f"unix://{self.scratch}/strict.sock"], authorise=wrong) as strict, \
                cles.connect(strict.endpoints[0]) as asking:
            with self.assertLogs("cles", "ERROR"):
                await self.fails("denied", asking.pull("self:cles"))

    async def test_a_trace_shows_what_was_received_and_sent(self):
        async with cles.Node("cam1", listen=[f"unix://{self.scratch}/cam1.sock"], peers={"car1": self.car.endpoints[0]}) as cam, \
                cles.connect(cam.endpoints[0]) as client:
            self.car.on_pull("speed")(lambda: 1)

            @cam.on_pull("speed")
            async def speed(request):
                return await cam.pull("car1:speed", trace=request.trace)

            trace = cles.Trace("4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7", True)
            self.assertEqual(await client.pull("cam1:speed", trace=trace), 1)
            spans = (await client.pull(f"cam1:cles/trace/{trace.id}"))["spans"]
            self.assertEqual([(s["kind"], s["target"], s["outcome"]) for s in spans],
                             [("received", "cam1", "ok"), ("sent", "car1", "ok")])
            self.assertEqual(spans[1]["parent"], spans[0]["span"])
            there = (await cam.pull(f"car1:cles/trace/{trace.id}"))["spans"]
            self.assertEqual(there[0]["parent"], spans[1]["span"])
            own = next(iter(client.core.spans.describe(trace.id, client.core.now())))
            self.assertEqual(spans[0]["parent"], own["span"])

    async def test_nobody_listens(self):
        async with cles.connect("tcp://127.0.0.1:1") as client:
            await self.fails("unavailable", client.pull("car1:speed"))
        async with cles.connect(f"unix://{self.scratch}/none.sock") as client:
            await self.fails("unavailable", client.pull("car1:speed"))
        async with cles.Node("lonely") as lonely:
            await self.fails("no_target", lonely.pull("car1:speed"))

    async def test_a_node_that_closes_ends_in_order(self):
        began = asyncio.Event()

        @self.car.on_delegate("work")
        async def work():
            began.set()
            await asyncio.sleep(0.1)
            return "done"

        client = await self.client()
        raw = await self.raw(self.car.endpoints[0])
        raw.send("PULL self:cles/metrics")
        await raw.line()
        started = asyncio.create_task(client.delegate("car1:work"))
        await began.wait()
        closing = asyncio.create_task(self.car.close())
        await asyncio.sleep(0.01)
        self.assertIn('"busy"', await raw.ask("PULL car1:cles"))
        self.assertEqual(await started, "done")
        await closing
        self.assertEqual(await raw.line(), "PUSH self:cles/leaving reply=no")


class Rules(AsyncTest):
    async def test_access(self):
        asked = []

        def only_look(wanted):
            asked.append((wanted.verb, wanted.noun.path, wanted.peer.transport))
            return wanted.verb == "PULL" and wanted.noun.task != "secret"

        async with cles.Node("car1", listen=["unix://@cles-test-rules"], authorise=only_look) as car, \
                cles.connect("unix://@cles-test-rules") as client:
            for task in ("open", "secret"):
                car.on_pull(task)(lambda: 1)
            car.on_push("open")(lambda: None)
            self.assertEqual(await client.pull("car1:open"), 1)
            for work in (client.pull("car1:secret"), client.push("car1:open")):
                with self.assertRaises(cles.Error) as caught:
                    await work
                self.assertEqual(caught.exception.code, "denied")
            self.assertEqual(asked[0], ("PULL", "open", "unix"))

    async def test_addresses(self):
        for url, says in (("tcp://0.0.0.0:0", "insecure=True"), ("tls://127.0.0.1:0", "ssl cannot check"),
                          ("http://x", "not an address"), ("unix://relative", "not an address"),
                          ("tcp://x:70000", "at most 65535"), ("unix:///" + "x" * 120, "107 bytes")):
            with self.assertRaisesRegex(cles.RefusedError, says):
                cles.Node("car1", listen=[url])
        with self.assertRaises(ValueError):
            cles.Node("any")
        async with cles.connect("tls://127.0.0.1") as client:
            with self.assertRaisesRegex(cles.RefusedError, "needs the key of a member"):
                await client.pull("self:cles")
        with self.assertRaises(OSError):
            async with cles.Node("a", listen=["tcp://127.0.0.1:0"]) as a, cles.Node("b", listen=a.endpoints):
                pass


if __name__ == "__main__":
    unittest.main()
