#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Two pools of a secured fleet, joined through a NATS server that reads, alters and repeats what passes through it."""

import json
import os
import re
import shutil
import socket
import subprocess
import threading
import time
import unittest

from daemon import PLUGINS, clean_environment
from fleet import COUNTING
from nats import NatsServer
from nats_server import MISSING, PROGRAM
from secured import Fleet, Node
from support import CLES, PATIENCE, wait_until

MEMBERS = ("hub", "gate", "gate2", "car1", "operator", "stranger")
BRIDGES = ("hub", "gate", "gate2")
SEALED = (0x85, 0x86, 0x87, 0x88)  # POOL, ASK, ROSTER and SESSION


class Recorder:
    """A client of the server that keeps every message of CLES."""

    def __init__(self, server):
        self.client = server.client()
        self.client.subscribe("cles.>")
        self.messages = []
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self):
        try:
            while True:
                self.messages.append(self.client.read_bytes())
        except (AssertionError, OSError, ValueError):
            pass

    def close(self):
        self.client.socket.shutdown(socket.SHUT_RDWR)
        self.thread.join()
        self.client.close()


class SecuredFederation(unittest.TestCase):
    def setUp(self):
        self.fleet = Fleet(*MEMBERS)
        self.addCleanup(self.fleet.__exit__)
        self.server = NatsServer()
        self.addCleanup(self.server.__exit__)
        self.recorder = Recorder(self.server)
        self.addCleanup(self.recorder.close)
        folder = self.fleet.file("plugins")
        os.makedirs(folder)
        os.chmod(folder, 0o755)
        for file in (COUNTING, f"{PLUGINS}/libcles-primes.so", f"{PLUGINS}/libcles-system.so"):
            os.chmod(shutil.copy(file, folder), 0o644)
        self.marks_file = self.fleet.write("", "marks")
        self.plugins = (f"drain: 300ms\nplugin_path: {folder}\n"
                        "plugins: [libcles-system.so, libcles-primes.so, "
                        f"{{path: {os.path.basename(COUNTING)}, config: {{marks: {self.marks_file}}}}}]\n")

    def let_bridges_forward(self):
        self.fleet.let_forward(*BRIDGES)
        self.fleet.spread(*MEMBERS)

    def node(self, name, pool, bridge=True, more=""):
        pool_lines = f"federation: {{nats: '{self.server.url}', pool: {pool}}}\n" if bridge else f"pool: {pool}\n"
        node = Node(self.fleet, name, self.plugins + pool_lines + more)
        self.addCleanup(node.__exit__)
        return node

    def two_pools(self):
        self.let_bridges_forward()
        hub, gate = self.node("hub", "south"), self.node("gate", "north")
        for one in (hub, gate):
            self.wait_for_pools(one, 1)
        return hub, gate

    def metrics(self, node):
        return json.loads(node.ask("PULL self:cles/metrics"))["federation"]

    def wait_for_pools(self, node, many):
        wait_until(lambda: sum(p["state"] == "live" for p in self.metrics(node).get("pools", [])) == many,
                   f"{many} other pools are live")

    def ask(self, node, request):
        return json.loads(node.ask(request))

    def marks(self):
        with open(self.marks_file, encoding="utf-8") as marks:
            return [line.split()[0] for line in marks.read().splitlines()]

    def cles(self, keys, *arguments):
        done = subprocess.run([CLES, *arguments, "-k", self.fleet.keys(keys), "-o", "json"], stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, env=clean_environment(CLES_MULTICAST="off"),
                              timeout=PATIENCE, check=False)
        return done.returncode, done.stdout.strip(), done.stderr

    def test_all_of_the_language_crosses(self):
        hub, gate = self.two_pools()
        car = self.node("car1", "north", bridge=False)
        wait_until(lambda: "car1" in gate.peers(), "gate knows car1")
        self.assertIn("seconds", self.ask(hub, "PULL north.gate:utc"))
        wait_until(lambda: "seconds" in self.ask(hub, "PULL car1:utc"), "its name is known")
        self.assertEqual(self.ask(gate, "PULL south.hub:prime/97"), {"value": True})
        self.assertEqual(self.ask(hub, "DELEGATE north.car1:once/1/0"), {"value": "car1"})
        self.assertIn(self.ask(hub, "DELEGATE north.any:once/2/0")["value"], ("gate", "car1"))
        self.assertEqual(set(self.ask(hub, "PULL all:prime/7")["results"]), {"hub", "north.gate", "north.car1"})
        self.assertEqual(self.marks(), ["1", "2"])
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(PATIENCE)
            link.connect(hub.socket)
            lines = link.makefile("r", encoding="utf-8")
            link.sendall(b"BIND north.car1:utc id=1\n")
            seen = [json.loads(lines.readline().split(" ", 1)[1])]
            updates = [lines.readline() for _ in range(3)]
            self.assertTrue(all(line.startswith("UPDATE north.car1:utc seq=") for line in updates), (seen, updates))
            lines.close()
        # What NATS sees is sealed. Only nouns that are bound are in subjects.
        self.assertTrue(self.recorder.messages)
        self.assertEqual([m for m in self.recorder.messages if not m[2] or m[2][0] not in SEALED], [])
        self.assertEqual({subject for subject, _, _ in self.recorder.messages if "car1" in subject},
                         {"cles.north.feed.car1.utc"})
        self.assertEqual([m for m in self.recorder.messages if b"seconds" in m[2] or b"deadline=" in m[2]], [])
        self.assertEqual(car.process.poll(), None)

    def test_requesters_keep_their_rights(self):
        self.fleet.run("fleet", "rights", "operator", "--may", "delegate *:ordered/**", "--may", "pull *:prime/**",
                       "--may", "pull *:cles", "--keys", self.fleet.authority)
        hub, gate = self.two_pools()
        car = self.node("car1", "north", bridge=False)
        wait_until(lambda: "car1" in gate.peers(), "gate knows car1")
        wait_until(lambda: "seconds" in self.ask(hub, "PULL car1:utc"), "its name is known")
        for target in ("car1", "north.car1"):
            self.assertEqual(self.cles("operator", "pull", f"{target}:prime/7", "--at", hub.url)[1], '{"value":true}')
            code, _, errors = self.cles("operator", "pull", f"{target}:utc", "--at", hub.url)
            self.assertNotEqual(code, 0)
            self.assertIn(f"operator may not send PULL 'utc' to {target}", errors)
        # The requester's own signature crosses, and is made for the node that runs the order.
        for number, target in enumerate(("car1", "north.car1"), 1):
            self.assertEqual(self.cles("operator", "delegate", f"{target}:ordered/{number}/0", "--at", hub.url)[1:],
                             ('{"value":"car1"}', ""))
        code, _, errors = self.cles("operator", "delegate", "car1:once/9/0", "--at", hub.url)
        self.assertNotEqual(code, 0)
        self.assertEqual(self.marks(), ["1", "2"], errors)
        self.assertEqual(car.process.poll(), None)

    def test_a_bridge_lends_nobody_its_rights(self):
        """Bridges may forward for each other only, which the log advises."""
        self.fleet.run("fleet", "rights", "operator", "--may", "pull *:prime/**", "--may", "pull *:cles", "--keys",
                       self.fleet.authority)
        for name, other in (("hub", "gate"), ("gate", "hub")):
            self.fleet.let_forward(name, who=other)
        self.fleet.spread(*MEMBERS)
        hub, gate = self.node("hub", "south"), self.node("gate", "north")
        for one in (hub, gate):
            self.wait_for_pools(one, 1)
        for target in ("all", "any", "north.all", "north.any", "north.gate", "gate"):
            self.cles("operator", "delegate", f"{target}:once/1/0", "--at", hub.url)
        self.assertEqual(self.marks(), [])
        code, out, _ = self.cles("operator", "pull", "all:prime/7", "--at", hub.url)
        found = json.loads(out)
        self.assertEqual(set(found["results"]), {"hub"}, (code, found))
        self.assertEqual(found["errors"]["north.all"]["error"], "denied")
        self.assertIn("hub may not forward requests of operator to north.all", found["errors"]["north.all"]["message"])
        self.assertEqual(gate.process.poll(), None)

    def test_orders_reach_any_and_all_of_another_pool(self):
        """Whichever bridge forwards which attempt."""
        hub, gate = self.two_pools()
        gate2 = self.node("gate2", "north")
        wait_until(lambda: self.metrics(hub)["pools"][0]["bridges"] == 2, "hub knows both")
        wait_until(lambda: gate2.peers() == {"gate"} and gate.peers() == {"gate2"}, "they know each other")
        for number in range(1, 13):
            code, out, errors = self.cles("operator", "delegate", f"north.gate:ordered/{number}/0", "--at", hub.url)
            self.assertEqual((code, out), (0, '{"value":"gate"}'), errors)
        code, out, errors = self.cles("operator", "delegate", "north.any:ordered/13/0", "--at", hub.url)
        self.assertEqual(code, 0, errors)
        code, out, errors = self.cles("operator", "delegate", "all:ordered/14/0", "--at", hub.url)
        self.assertEqual(set(json.loads(out)["results"]), {"hub", "north.gate", "north.gate2"}, errors)
        self.assertEqual(sorted(int(mark) for mark in self.marks()), [*range(1, 14), 14, 14, 14])

    def test_what_others_send_has_no_effect(self):
        hub, gate = self.two_pools()
        self.assertEqual(self.ask(hub, "DELEGATE north.gate:once/1/0"), {"value": "gate"})
        self.assertEqual(self.ask(hub, "DELEGATE north.gate:again/2/0"), {"value": "gate"})
        before = self.metrics(gate)["messages_refused"]
        recorded = list(self.recorder.messages)
        to_gate = next(subject for subject, _, _ in recorded if re.match(r"cles\.north\.bridge\..*\.request", subject))
        with self.server.client() as nats:
            # In plain text, altered, and repeated: on their subjects, and on others.
            nats.publish("cles.north.delegate.gate.once", "/3/0", "_INBOX.1")
            for subject, reply, data in recorded:
                nats.publish(subject, data, reply)
                altered = bytearray(data)
                altered[len(data) // 2] ^= 1
                nats.publish(subject, bytes(altered), reply)
                nats.publish(to_gate, data, reply)
            nats.flush()
        wait_until(lambda: self.metrics(gate)["messages_refused"] > before + 2 * len(recorded) / 3, "they were refused")
        self.assertEqual(self.ask(hub, "DELEGATE north.gate:once/4/0"), {"value": "gate"})
        self.assertEqual(self.marks(), ["1", "2", "4"])
        # After a restart of the bridge that has seen them, too.
        gate.__exit__()
        gate = self.node("gate", "north")
        self.wait_for_pools(gate, 1)
        self.wait_for_pools(hub, 1)
        with self.server.client() as nats:
            for subject, reply, data in recorded:
                nats.publish(subject, data, reply)
            nats.flush()
        self.assertEqual(self.ask(hub, "DELEGATE north.gate:once/5/0"), {"value": "gate"})
        self.assertEqual(self.marks(), ["1", "2", "4", "5"])

    def test_a_bridge_needs_the_right_to_forward(self):
        hub, gate = self.node("hub", "south"), self.node("gate", "north")
        wait_until(lambda: any("dropped what 'gate' has sent through NATS: it may not forward for this node "
                               "(cles fleet rights gate --forwards hub)" in text
                               for text in hub.messages()), "hub says what it lacks")
        self.assertIn(self.ask(hub, "PULL north.gate:utc")["error"], ("no_target", "unavailable"))
        found = json.loads(self.cles("operator", "doctor", "--at", hub.url)[1])["findings"]
        self.assertIn(("warning", "hub has dropped what gate sent through NATS: it may not forward for hub"),
                      [(each["verdict"], each["text"]) for each in found if each["check"] == "federation"], found)
        # The new roster reaches the other pool through NATS.
        self.fleet.let_forward("hub", "gate")
        self.fleet.spread("hub")
        self.wait_for_pools(hub, 1)
        self.wait_for_pools(gate, 1)
        self.assertIn("seconds", self.ask(hub, "PULL north.gate:utc"))
        self.assertIn("seconds", self.ask(gate, "PULL south.hub:utc"))

    def test_a_member_that_was_removed_is_out(self):
        hub, gate = self.two_pools()
        self.assertIn("seconds", self.ask(hub, "PULL north.gate:utc"))
        self.fleet.run("fleet", "remove", "hub", "--keys", self.fleet.authority)
        self.fleet.spread("gate")
        begun = time.monotonic()
        wait_until(lambda: self.metrics(gate)["pools"] and self.metrics(gate)["pools"][0]["state"] == "lost",
                   "its pool is lost")
        took = time.monotonic() - begun
        print(f"the pool of a removed bridge is lost {took:.2f} s after the roster has arrived")
        self.assertLess(took, 2)
        self.assertIn("error", self.ask(hub, "PULL north.gate:utc deadline=1000"))
        self.assertIn("error", self.ask(gate, "PULL south.hub:utc deadline=1000"))

    def test_a_member_that_was_added_again_is_back(self):
        """It has another number then, and so has its bridge."""
        hub, gate = self.two_pools()
        self.fleet.run("fleet", "remove", "hub", "--keys", self.fleet.authority)
        self.fleet.spread("gate")
        wait_until(lambda: self.metrics(gate)["pools"][0]["state"] == "lost", "it is out")
        self.fleet.run("fleet", "add", os.path.join(self.fleet.keys("hub"), "hub.pub"), "--may", "all", "--keys",
                       self.fleet.authority)
        self.fleet.let_forward("hub")
        self.fleet.spread("hub", "gate")
        wait_until(lambda: "seconds" in self.ask(hub, "PULL north.gate:utc deadline=1000"), "requests cross again")
        wait_until(lambda: "seconds" in self.ask(gate, "PULL south.hub:utc deadline=1000"), "in both directions")

    def test_the_others_go_on_when_a_member_is_removed(self):
        """Both group keys are drawn anew; the other pool gets the roster through NATS."""
        hub, gate = self.two_pools()
        self.fleet.run("fleet", "remove", "stranger", "--keys", self.fleet.authority)
        self.fleet.spread("gate")
        wait_until(lambda: self.ask(hub, "PULL self:cles")["roster"] == self.ask(gate, "PULL self:cles")["roster"],
                   "hub has the roster of gate")
        wait_until(lambda: "seconds" in self.ask(hub, "PULL north.gate:utc deadline=1000"), "requests cross again")

    def test_bridges_of_one_pool(self):
        hub, gate = self.two_pools()
        gate2 = self.node("gate2", "north")
        wait_until(lambda: self.metrics(hub)["pools"][0]["bridges"] == 2, "hub knows both")
        wait_until(lambda: gate2.peers() == {"gate"} and self.metrics(gate2)["pools"], "gate2 knows them")
        wait_until(lambda: "value" in self.ask(hub, "DELEGATE north.any:again/0/0"), "it takes requests")
        for number in range(1, 41):
            wait_until(lambda number=number: "value" in self.ask(hub, f"DELEGATE north.any:once/{number}/0"),
                       "an answer, if not `busy`")
        self.assertEqual(sorted(int(mark) for mark in self.marks() if mark != "0"), list(range(1, 41)))
        for node in (gate, gate2):
            self.assertGreater(self.metrics(node)["requests_taken"], 0)
        # A noun is bound at the one that publishes it, by whichever of them takes the request.
        for name in ("gate", "gate2"):
            with socket.socket(socket.AF_UNIX) as link:
                link.settimeout(PATIENCE)
                link.connect(hub.socket)
                lines = link.makefile("r", encoding="utf-8")
                link.sendall(f"BIND north.{name}:utc id=1\n".encode())
                self.assertTrue(lines.readline().startswith("id=1 {"))
                self.assertTrue(lines.readline().startswith(f"UPDATE north.{name}:utc seq="))
                lines.close()


if __name__ == "__main__":
    if PROGRAM is None:
        raise SystemExit(MISSING)
    unittest.main()
