#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Daemons of two pools reach each other through a NATS server, which may refuse, restart, or carry anything else."""

import json
import signal
import time
import unittest
from collections import Counter
from pathlib import Path

from bridges import BridgesTest, pool_of
from daemon import DEFAULTS, body, clesd
from nats_server import MISSING, PROGRAM
from support import PATIENCE, cles, wait_until


def is_stopped(process):
    """Whether all its threads are."""
    states = []
    for stat in Path(f"/proc/{process}/task").glob("*/stat"):
        states.append(stat.read_text().rpartition(")")[2].split()[0])
    return set(states) == {"T"}


class Federation(BridgesTest):
    def two_pools(self, more=""):
        server = self.server(more)
        hub, gate = self.node("hub", "south", server), self.node("gate", "north", server)
        self.wait_for_pools(hub, gate)
        return server, hub, gate

    def count_marks(self, number):
        return [line.split()[0] for line in self.folder.read("marks").splitlines()].count(str(number))

    def test_requests_cross(self):
        _, hub, gate = self.two_pools()
        self.assertIn("seconds", json.loads(hub.ask("PULL north.gate:utc")))
        wait_until(lambda: "seconds" in json.loads(hub.ask("PULL gate:utc")), "its name is known")
        self.assertIn("seconds", json.loads(gate.ask("PULL south.hub:utc")))
        self.assertEqual(json.loads(hub.ask("PULL north.gate:prime/97")), {"value": True})
        self.assertEqual(json.loads(hub.ask("DELEGATE north.gate:once/1/0")), {"value": "gate"})
        self.assertEqual(json.loads(hub.ask("DELEGATE north.any:once/2/0")), {"value": "gate"})
        self.assertEqual(self.count_marks(1), 1)
        # The own pool by its name; and a pool, a node and a task that do not exist.
        self.assertEqual(json.loads(hub.ask("DELEGATE south.hub:once/3/0")), {"value": "hub"})
        time.sleep(1)  # until then, a pool may still appear
        self.assertEqual(json.loads(hub.ask("PULL west.gate:utc"))["error"], "no_target")
        self.assertEqual(json.loads(hub.ask("PULL north.nobody:utc"))["error"], "no_target")
        self.assertEqual(json.loads(hub.ask("PULL north.gate:nothing"))["error"], "no_task")
        self.assertEqual(json.loads(hub.ask("PUSH north.gate:cles/cancel/1"))["error"], "no_target")

    def test_programs_that_a_bridge_starts_inherit_no_descriptor(self):
        _, hub, gate = self.two_pools()
        self.assertEqual(hub.inherited() + gate.inherited(), [])

    def test_requests_reach_nodes_behind_the_bridges(self):
        server = self.server()
        hub, gate = self.node("hub", "south", server), self.node("gate", "north", server)
        inner = self.node("inner", "north", None, more=f"seeds: ['{gate.url}']\n")
        self.wait_for_pools(hub, gate)
        wait_until(lambda: "seconds" in json.loads(hub.ask("PULL inner:utc")), "its name is known")
        self.assertEqual(json.loads(hub.ask("DELEGATE inner:once/1/0")), {"value": "inner"})
        self.assertEqual(json.loads(hub.ask("DELEGATE north.inner:once/2/0")), {"value": "inner"})
        everybody = json.loads(hub.ask("PULL north.all:prime/7"))
        self.assertEqual(everybody, {"results": {"gate": {"value": True}, "inner": {"value": True}}, "errors": {}})
        inner.stop()
        self.assertIn(json.loads(hub.ask("PULL north.inner:utc deadline=2000"))["error"], ("unavailable", "no_target"))

    def test_what_is_meant_for_a_pool_does_not_run_in_another(self):
        server = self.server()
        hub, gate = self.node("hub", "south", server), self.node("gate", "north", server)
        east = self.node("east1", "east", server)
        car = self.node("car1", "east", None, more=f"seeds: ['{east.url}']\n")
        self.wait_for_pools(hub, gate, east)
        wait_until(lambda: "seconds" in json.loads(gate.ask("PULL car1:utc")), "north knows the node of east")
        self.assertEqual(json.loads(hub.ask("DELEGATE east.car1:once/1/0")), {"value": "car1"})
        for request in ("DELEGATE north.car1:once/2/0", "BIND north.car1:utc"):
            self.assertEqual(body(hub.ask(request))["error"], "no_target")
        self.assertEqual(self.count_marks(2), 0)
        self.assertEqual(car.stop()[0], 0)

    def test_any_and_all(self):
        server = self.server()
        hub = self.node("hub", "south", server, has_work=False)
        gate = self.node("gate", "north", server)
        self.wait_for_pools(hub, gate)
        # Home first; elsewhere what nobody offers at home.
        self.assertIn("seconds", json.loads(hub.ask("PULL any:utc")))
        self.assertEqual(pool_of(gate)["requests_taken"], 0)
        self.assertEqual(json.loads(hub.ask("DELEGATE any:once/1/0")), {"value": "gate"})
        self.assertEqual(json.loads(hub.ask("PULL any:nothing"))["error"], "no_target")
        everybody = json.loads(hub.ask("PULL all:utc"))
        self.assertEqual(set(everybody["results"]), {"hub", "north.gate"})
        self.assertEqual(everybody["errors"], {})
        self.assertEqual(json.loads(gate.ask("PULL all:prime/7")), {"results": {"gate": {"value": True}}, "errors": {}})
        self.assertEqual(json.loads(hub.ask("PULL all:prime/7")), {"results": {"north.gate": {"value": True}}, "errors": {}})
        self.assertEqual(json.loads(hub.ask("PULL all:nothing"))["error"], "no_target")
        self.assertEqual(set(json.loads(hub.ask("PULL south.all:utc"))["results"]), {"hub"})
        code, out, errors = cles("ls", "--pools", "--at", hub.url, "-o", "json")
        self.assertEqual((code, json.loads(out)), (0, {"pools": [
            {"bridge": "hub", "pool": "north", "state": "live", "bridges": 1, "nodes": 1}]}), errors)
        gate.process.kill()
        wait_until(lambda: pool_of(hub)["pools"] == 0, "the loss is noticed")
        code, out, _ = cles("ls", "--pools", "--at", hub.url, "-o", "table")
        self.assertEqual((code, out.splitlines()[0].split()), (0, ["BRIDGE", "POOL", "STATE", "BRIDGES", "NODES"]))
        self.assertEqual(out.splitlines()[1].split()[:3], ["hub", "north", "lost"])
        everybody = json.loads(hub.ask("PULL all:utc"))
        self.assertEqual(set(everybody["results"]), {"hub"})
        self.assertEqual(everybody["errors"]["north.all"]["error"], "unavailable")

    def test_any_leaves_a_pool_without_room(self):
        server = self.server()
        hub = self.node("hub", "south", server, more="queue: 1\n")
        gate = self.node("gate", "north", server)
        self.wait_for_pools(hub, gate)
        with hub.connect() as link:
            for number in (1, 2):
                link.send(f"DELEGATE hub:holds/{number} id={number} deadline=60000")
                wait_until(lambda number=number: self.count_marks(number) == 1, "a worker runs it")
            link.send("DELEGATE hub:holds/3 id=3 deadline=60000")
            wait_until(lambda: json.loads(hub.ask("PULL self:cles/metrics"))["pool"]["queued"] == 1, "the queue is full")
            self.assertEqual(json.loads(hub.ask("DELEGATE hub:once/4/0"))["error"], "busy")
            self.assertEqual(json.loads(hub.ask("DELEGATE any:once/5/0")), {"value": "gate"})
        self.assertEqual(self.count_marks(5), 1)

    def test_progress_deadline_and_cancellation(self):
        _, hub, _ = self.two_pools()
        with hub.connect() as link:
            link.send('DELEGATE north.gate:primes id=7 progress=yes {"below":100000}')
            lines = [link.read()]
            while "progress=" in lines[-1]:
                lines.append(link.read())
            self.assertGreater(len(lines), 1)
            self.assertEqual(body(lines[-1])["count"], 9592)
            begun = time.monotonic()
            self.assertEqual(body(link.ask("DELEGATE north.gate:holds/1 id=8 deadline=300"))["error"], "deadline")
            self.assertLess(time.monotonic() - begun, 0.3 + PATIENCE / 10)
            link.send("DELEGATE north.gate:holds/2 id=9")
            wait_until(lambda: self.count_marks(2) == 1, "it runs")
            link.send("PUSH self:cles/cancel/9 id=10")
            answers = {link.read().split(" ")[0], link.read().split(" ")[0]}
            self.assertEqual(answers, {"id=9", "id=10"})
            # Its worker is free again: both workers run these.
            for number in (11, 12):
                link.send(f"DELEGATE north.gate:once/{number}/50 id={number}")
            self.assertEqual({body(link.read())["value"], body(link.read())["value"]}, {"gate"})

    def test_bindings_cross(self):
        _, hub, gate = self.two_pools()
        with hub.connect() as one, hub.connect() as other:
            self.assertTrue(one.ask("BIND north.gate:utc id=1").startswith("id=1 {"))
            first = one.read()
            self.assertTrue(first.startswith("UPDATE north.gate:utc seq="), first)
            self.assertIn("seconds", other.ask("BIND north.gate:utc id=1"))
            for _ in range(3):
                self.assertTrue(other.read().startswith("UPDATE north.gate:utc seq="))
            wait_until(lambda: pool_of(gate)["updates_sent"] >= 3, "updates are counted")
            one.send("BIND north.gate:nothing id=2")
            self.assertEqual(body(self.reply_to(one, 2))["error"], "no_task")
        wait_until(lambda: pool_of(gate)["updates_sent"] == self.sent_a_while_ago(gate), "the binding has ended")

    @staticmethod
    def reply_to(link, number):
        """Updates may precede it."""
        while not (line := link.read()).startswith(f"id={number} "):
            if not line.startswith("UPDATE "):
                raise AssertionError(line)
        return line

    def sent_a_while_ago(self, gate):
        sent = pool_of(gate)["updates_sent"]
        time.sleep(1.5)
        return sent

    def test_a_lost_bridge(self):
        server, hub, gate = self.two_pools()
        other = self.node("other", "north", server, more=f"seeds: ['{gate.url}']\n")
        wait_until(lambda: pool_of(hub)["bridges"] == 3, "all bridges are known")
        with hub.connect() as link:
            for number in range(20):
                link.send(f"DELEGATE north.gate:holds/{number} id={number + 1} deadline=60000")
            wait_until(lambda: sum(self.count_marks(n) for n in range(20)) >= 2, "workers run some")
            gate.process.kill()
            begun = time.monotonic()
            codes = [body(link.read())["error"] for _ in range(20)]
            self.assertEqual(set(codes) - {"unavailable", "deadline"}, set())
            self.assertLess(time.monotonic() - begun, 5 + PATIENCE / 10)
        self.assertEqual(json.loads(hub.ask("DELEGATE north.other:once/77/0")), {"value": "other"})
        self.assertEqual(self.count_marks(77), 1)
        self.assertIsNotNone(other)

    def test_a_bridge_that_leaves_loses_no_request(self):
        """What the server has for it is answered before it ends: done, or not begun."""
        server, hub, gate = self.two_pools()
        self.node("other", "north", server, more=f"seeds: ['{gate.url}']\n")
        wait_until(lambda: pool_of(hub)["bridges"] == 3, "all bridges are known")
        outcomes = Counter()
        with hub.connect() as link:
            for number in range(1, 1001):
                link.send(f"PULL north.any:prime/97 id={number} deadline=10000")
                if number == 200:
                    gate.send_signal(signal.SIGTERM)
                if number > 64:
                    outcomes[body(link.read()).get("error", "done")] += 1
            for _ in range(64):
                outcomes[body(link.read()).get("error", "done")] += 1
        self.assertEqual(gate.end()[0], 0)
        self.assertEqual(set(outcomes) - {"done", "busy"}, set(), outcomes)
        self.assertGreater(outcomes["done"], 500, outcomes)

    def test_a_server_that_restarts(self):
        server, hub, gate = self.two_pools()
        with hub.connect() as link:
            self.assertTrue(link.ask("BIND north.gate:utc id=1").startswith("id=1 {"))
            link.read()
            server.stop()
            hub.wait_for_entry("the connection to NATS was lost")
            reply = json.loads(hub.ask("PULL north.gate:utc deadline=3000"))
            self.assertEqual(reply["error"], "unavailable")
            # The own pool is not affected.
            self.assertIn("seconds", json.loads(hub.ask("PULL hub:utc")))
            self.assertIn("seconds", json.loads(hub.ask("PULL any:utc")))
            hub.wait_for_entry("cannot connect to NATS")
            server.start()
            started = time.time()
            wait_until(lambda: "seconds" in json.loads(hub.ask("PULL north.gate:utc")), "it works again")
            while body(link.read())["seconds"] < started:  # then it is bound again by itself
                pass
        self.assertLess(sum("cannot connect to NATS" in e["message"] for e in hub.entries()), 3)
        self.assertEqual(pool_of(gate)["connections"], 2)

    def test_a_server_that_is_full(self):
        server = self.server("max_connections: 1")
        hub = self.node("hub", "south", server)
        hub.wait_for_entry("connected to NATS")
        gate = self.node("gate", "north", server)
        entry = gate.wait_for_entry("cannot connect to NATS")
        self.assertRegex(entry["message"], "(?i)maximum (of )?connections")
        self.assertIn("seconds", json.loads(gate.ask("PULL gate:utc")))
        self.assertEqual(hub.stop()[0], 0)
        gate.wait_for_entry("connected to NATS, as a bridge")

    def test_a_server_that_hangs(self):
        server, hub, gate = self.two_pools()
        server.process.send_signal(signal.SIGSTOP)
        wait_until(lambda: is_stopped(server.process.pid), "it is stopped")
        try:
            with hub.connect() as link:
                begun = time.monotonic()
                for number in range(1, 101):
                    link.send(f"DELEGATE north.gate:once/{number}/0 id={number} deadline=10000")
                self.assertEqual({body(link.read())["error"] for _ in range(100)}, {"unavailable"})
                self.assertLess(time.monotonic() - begun, 4 + PATIENCE / 10)
            self.assertIn("seconds", json.loads(hub.ask("PULL hub:utc")))
            hub.wait_for_entry("the connection to NATS was lost")
            gate.wait_for_entry("the connection to NATS was lost")
        finally:
            server.process.send_signal(signal.SIGCONT)
        wait_until(lambda: "seconds" in json.loads(hub.ask("PULL north.gate:utc")), "it works again")
        marks = self.folder.read("marks").splitlines()
        self.assertEqual(len(set(marks)), len(marks))

    def test_no_server(self):
        server = self.server()
        server.stop()
        hub = self.node("hub", "south", server)
        hub.wait_for_entry("cannot connect to NATS")
        begun = time.monotonic()
        self.assertEqual(json.loads(hub.ask("PULL north.gate:utc"))["error"], "unavailable")
        self.assertLess(time.monotonic() - begun, 2 + PATIENCE / 10)
        self.assertEqual(json.loads(hub.ask("PULL nobody:utc"))["error"], "no_target")
        self.assertIn("seconds", json.loads(hub.ask("PULL self:utc")))
        code, took = hub.stop()
        self.assertEqual(code, 0)
        self.assertLess(took, 3 + PATIENCE / 10)

    def test_messages_that_are_too_long(self):
        _, hub, _ = self.two_pools("max_payload: 4096")
        long = json.dumps({"x": "x" * 8000})
        reply = json.loads(hub.ask(f"PUSH north.gate:utc {long}"))
        self.assertEqual(reply["error"], "too_large")
        self.assertIn("seconds", json.loads(hub.ask("PULL north.gate:utc")))
        reply = json.loads(hub.ask("PULL north.gate:processes"))
        self.assertTrue("error" not in reply or reply == {**reply, "error": "too_large", "ran": True}, reply)
        self.assertEqual(pool_of(hub)["connections"], 1)

    def test_programs_and_foreign_messages(self):
        server, hub, gate = self.two_pools()
        with server.client() as client:
            self.assertEqual(json.loads(client.request("cles.north.pull.gate.prime", "/97")), {"value": True})
            self.assertEqual(json.loads(client.request("cles.north.delegate.gate.primes", '{"below":100}'))["count"], 25)
            self.assertEqual(json.loads(client.request("cles.north.pull.gate.prime", "/97\nPULL gate:utc"))["error"],
                             "bad_request")
            self.assertEqual(json.loads(client.request("cles.north.push.gate.cles", "/cancel/1"))["error"], "no_target")
            for subject in ("cles.north.beat.0123456789abcdef", "cles.north.names.0123456789abcdef",
                            "cles.north.push.gate.utc", "cles.north.pull.gate.utc"):
                for payload in ("", "hello", "{}", b"\xff\x00\xfe", '{"node":', "x" * 100_000):
                    client.publish(subject, payload)
            client.flush()
        self.assertIn("seconds", json.loads(hub.ask("PULL north.gate:utc")))
        self.assertGreater(pool_of(gate)["messages_refused"], 0)
        self.assertLess(sum("dropped a message of NATS" in e["message"] for e in gate.entries()), 3)

    def test_each_request_runs_once_however_many_bridges_there_are(self):
        server, hub, gate = self.two_pools()
        others = [self.node(name, "north", server, more=f"seeds: ['{gate.url}']\n") for name in ("other", "third")]
        wait_until(lambda: pool_of(hub)["bridges"] == 4, "all bridges are known")
        with hub.connect() as link:
            for number in range(1, 301):
                link.send(f"DELEGATE north.any:once/{number}/0 id={number} deadline=20000")
            answers = [body(link.read()) for _ in range(300)]
        self.assertEqual([a for a in answers if "error" in a], [])
        marks = [line.split()[0] for line in self.folder.read("marks").splitlines()]
        self.assertEqual(sorted(marks, key=int), [str(number) for number in range(1, 301)])
        taken = [pool_of(node)["requests_taken"] for node in (gate, *others)]
        self.assertEqual(sum(taken), 300)
        self.assertNotIn(0, taken)  # the queue group gives some to each

    def test_names_with_dots(self):
        server = self.server()
        hub, gate = self.node("hub.one", "south", server), self.node("gate.two", "north", server)
        self.wait_for_pools(hub, gate)
        with server.client() as client:
            client.subscribe("cles.north.pull.*.*")
            self.assertIn("seconds", json.loads(hub.ask("PULL north.gate.two:utc")))
            self.assertEqual(client.read()[0], "cles.north.pull.gate%2Etwo.utc")
        wait_until(lambda: "seconds" in json.loads(hub.ask("PULL gate.two:utc")), "its name is known")

    def test_pools_in_via_end_loops(self):
        server, _, _ = self.two_pools()
        with server.client() as client:
            reply = json.loads(client.request("cles.north.pull.gate.utc", " via=north.x,south.hub"))
            self.assertEqual(reply["error"], "no_target")
            self.assertIn("'via' form a loop", reply["message"])
            self.assertIn("seconds", json.loads(client.request("cles.north.pull.gate.utc", " via=south.hub,west.y")))

    def test_a_pool_that_does_not_answer_harms_no_other(self):
        server, hub, gate = self.two_pools()
        west = self.node("well", "west", server)
        wait_until(lambda: pool_of(hub)["pools"] == 2, "all pools are known")
        gate.send_signal(signal.SIGSTOP)
        wait_until(lambda: is_stopped(gate.process.pid), "it is stopped")
        try:
            with hub.connect() as slow, hub.connect() as quick:
                for number in range(1, 201):
                    slow.send(f"DELEGATE north.gate:once/{number}/0 id={number} deadline=20000")
                times = []
                for number in range(1000, 1200):
                    begun = time.monotonic()
                    self.assertEqual(body(quick.ask(f"DELEGATE west.well:once/{number}/0 id=1"))["value"], "well")
                    times.append(time.monotonic() - begun)
                self.assertLess(sorted(times)[100], 0.5)
                # All are answered long before their deadline, when the pool is taken for lost.
                self.assertEqual({body(slow.read())["error"] for _ in range(200)}, {"unavailable"})
                self.assertEqual(pool_of(hub)["pools"], 1)
        finally:
            gate.send_signal(signal.SIGCONT)
        wait_until(lambda: "seconds" in json.loads(hub.ask("PULL north.gate:utc")), "it is found again")
        self.assertEqual(len(set(self.folder.read("marks").splitlines())),
                         len(self.folder.read("marks").splitlines()))
        self.assertIsNotNone(west)

    def test_top_shows_the_nodes_of_other_pools(self):
        _, hub, _ = self.two_pools()
        code, out, errors = cles("top", "--pools", "-n", "3", "-i", "1s", "--sort", "name", "--at", hub.url, "-o", "json")
        self.assertEqual(code, 0, errors)
        nodes = json.loads(out.splitlines()[-1])["nodes"]
        self.assertEqual([node["node"] for node in nodes], ["hub", "north.gate"])
        self.assertEqual([node["state"] for node in nodes], ["live", "live"])
        self.assertIn("requests_per_s", nodes[1])
        self.assertNotIn("failure", nodes[1])
        _, out, _ = cles("top", "-n", "1", "--at", hub.url, "-o", "json")
        self.assertEqual([node["node"] for node in json.loads(out)["nodes"]], ["hub"])

    def test_doctor_examines_the_connection(self):
        server, hub, gate = self.two_pools()
        wait_until(lambda: "round_trip_us" in pool_of(hub), "a heartbeat has come back")
        (verdict, text), = self.diagnosis(hub)
        self.assertEqual(verdict, "ok")
        self.assertRegex(text, r"^hub reaches NATS and 1 other pool; a message takes \d+\.\d\d ms there and back$")
        gate.process.kill()
        wait_until(lambda: pool_of(hub)["pools"] == 0, "the loss is noticed")
        self.assertEqual(self.diagnosis(hub)[1], ("warning", "hub cannot reach any bridge of: north"))
        server.stop()
        hub.wait_for_entry("cannot connect to NATS")
        (verdict, text), = self.diagnosis(hub)
        self.assertEqual(verdict, "failure")
        self.assertRegex(text, "^hub is not connected to NATS: .+")

    def test_doctor_names_what_nats_does_not_permit(self):
        server = self.server('''authorization { users: [{user: u, password: p, permissions: {
            subscribe: ["cles.south.*.*.*", "cles.south.bridge.>", "cles.*.names.*", "cles.*.feed.*.*"], publish: ["cles.>"]}}] }''')
        hub = self.node("hub", "south", server, url=f"nats://u:p@127.0.0.1:{server.port}")
        hub.wait_for_entry("ermission")
        wait_until(lambda: pool_of(hub).get("connected"), "it is connected")
        found = self.diagnosis(hub)
        self.assertEqual([verdict for verdict, _ in found], ["warning", "warning"], found)
        self.assertIn("NATS refuses a part of what hub does", found[0][1])
        self.assertIn("beat", found[0][1])
        self.assertIn("does not receive its own heartbeats", found[1][1])

    def test_configuration(self):
        for text, why in (
                ("federation: {pool: north}\n", "federation: has no 'nats'"),
                ("federation: {nats: 'nats://h:4222'}\n", "federation: has no 'pool'"),
                ("federation: {nats: 'tcp://h:4222', pool: north}\n", "'tcp://h:4222' is not the URL of a NATS server"),
                ("federation: {nats: 'nats://h:4222', pool: a.b}\n", "'a.b' is not a valid name of a pool"),
                ("federation: {nats: 'nats://h:4222', pool: north, tls: {key: /k}}\n", "only one of 'certificate' and 'key'"),
                ("insecure: true\npool: west\nfederation: {nats: 'nats://h:4222', pool: north}\n", "'north' is another pool than"),
                ("federation: yes\n", "is not 'off'"),
                ("federation: {nats: 'nats://h:4222', pool: north}\n",
                 "federation: whoever reaches the NATS server can send requests, which requires 'security' or 'insecure: true'")):
            file = self.folder.write(DEFAULTS + text)
            code, _, errors = clesd("--config", file, "--check")
            self.assertEqual(code, 2, text)
            self.assertIn(why, errors)
        file = self.folder.write(DEFAULTS + "insecure: true\nfederation: {nats: ['nats://a:1', 'tls://b:2'], pool: north, token: /t, tls: {ca: /c}}\n")
        _, text, _ = clesd("--config", file, "--print-config")
        self.assertIn('federation: {nats: ["nats://a:1", "tls://b:2"], pool: "north", token: "/t", tls: {ca: "/c"}}', text)


if __name__ == "__main__":
    if PROGRAM is None:
        raise SystemExit(MISSING)
    unittest.main()
