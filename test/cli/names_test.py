#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Ownership of names: nodes that are killed and restarted, two nodes of one name, and pools. On loopback, with a
separate group port for the tests."""

import json
import os
import signal
import subprocess
import time
import unittest

from support import Node, cles, environment, finish, free_port, read_line, start, wait_until

RETURNS_WITHIN = 1.5  # seconds, on an idle machine
PATIENT = 1 + float(os.environ.get("CLES_TEST_PATIENCE", "30")) / 60


def start_daemon(test, name="sat1"):
    """The URL of a clesd in the test's group."""
    command = [os.environ["CLESD"], "--node", name, "--listen", "tcp://127.0.0.1:0", "-m", test.group]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                               cwd="/", env=environment(XDG_CONFIG_HOME="/nowhere"))
    test.addCleanup(process.communicate)
    test.addCleanup(process.kill)
    return read_line(process).split()[-1]


class Names(unittest.TestCase):
    def setUp(self):
        self.group = f"lo,239.255.25.37:{free_port()}"
        self.env = environment(CLES_MULTICAST=self.group)

    def node(self, *arguments):
        made = Node("--multicast", self.group, *arguments)
        self.addCleanup(lambda: made.log.closed or made.stop())
        return made

    def run_by_name(self, *arguments):
        return cles(*arguments, env=self.env)

    def feed(self, noun):
        process = start("bind", noun, "-o", "raw", env=self.env)
        self.addCleanup(finish, process)
        self.addCleanup(process.kill)
        return process

    def returns(self, noun):
        """Seconds from the start of the publisher's next incarnation to its first update."""
        first = self.node("--name", "car1")
        feed = self.feed(noun)
        for _ in range(3):
            read_line(feed)
        first.stop(signal.SIGKILL)
        begun = time.monotonic()
        second = self.node("--name", "car1")
        self.assertNotEqual(first.port, second.port)
        # Updates of the first incarnation may still be unread: five of the second one arrive only later.
        for _ in range(5):
            self.assertTrue(read_line(feed))
        took = time.monotonic() - begun
        print(f"{noun}: back after {took:.2f} s")
        return took

    def test_a_feed_returns_soon_after_its_publisher_was_killed_and_started_elsewhere(self):
        self.assertLess(self.returns("car1:localization"), RETURNS_WITHIN * PATIENT)

    def test_so_does_one_by_multicast(self):
        self.assertLess(self.returns("all:localization"), RETURNS_WITHIN * PATIENT)

    def test_one_that_does_not_answer_any_more_gives_way(self):
        first = self.node("--name", "car1")
        watcher = self.node("--name", "car2")
        wait_until(lambda: '"car1"' in watcher.ask("PULL self:cles/peers"), "it is known")
        first.process.send_signal(signal.SIGSTOP)
        second = self.node("--name", "car1")
        begun = time.monotonic()
        wait_until(lambda: f":{second.port}" in watcher.ask("PULL self:cles/peers"), "the name has moved")
        self.assertLess(time.monotonic() - begun, RETURNS_WITHIN * PATIENT)
        first.process.kill()

    def test_the_second_of_a_name_does_not_start(self):
        first = self.node("--name", "car1")
        time.sleep(1.1)  # nodes that start within a second count as simultaneous
        code, _, err = cles("serve", "--name", "car1", "--listen", "tcp://127.0.0.1:0", "-m", self.group, env=self.env)
        self.assertEqual(code, 1, err)
        self.assertIn(f"the node at {first.url} had the name 'car1' first", err)
        self.assertIsNone(first.process.poll())
        self.assertEqual(self.run_by_name("pull", "car1:echo/x")[:2], (0, '{"parameters":["x"]}\n'))

    def test_two_that_are_allowed_to_clash_are_told_of_and_not_asked_by_name(self):
        first = self.node("--name", "car1")
        watcher = self.node("--name", "car2")
        time.sleep(1.1)
        second = self.node("--name", "car1", "--allow-clash")
        wait_until(lambda: '"clash"' in watcher.ask("PULL self:cles/peers"), "the clash is told")

        self.assertIsNone(second.process.poll())
        peers = json.loads(watcher.ask("PULL self:cles/peers"))["peers"]
        self.assertEqual([(p["node"], p["state"]) for p in peers], [("car1", "live"), ("car1", "clash")])
        self.assertEqual([p["endpoints"][0] for p in peers], [first.url, second.url])

    @unittest.skipUnless(os.environ.get("CLESD"), "this build has no clesd")
    def test_the_first_of_two_of_a_name_keeps_its_requests(self):
        first = self.node("--name", "car1")
        router = start_daemon(self)

        def asked(noun):
            code, out, err = cles("pull", noun, "--at", router, "-o", "json", env=self.env)
            self.assertEqual(code, 0, err)
            return json.loads(out)

        wait_until(lambda: asked("self:cles/peers")["peers"], "it is known")
        time.sleep(1.1)
        self.node("--name", "car1", "--allow-clash")
        wait_until(lambda: len(asked("self:cles/peers")["peers"]) == 2, "the clash is told")
        self.assertEqual(asked("car1:cles")["endpoints"][0], first.url)
        self.assertEqual(asked("any:echo/x"), {"parameters": ["x"]})
        self.assertEqual(asked("all:echo/x"), {"results": {"car1": {"parameters": ["x"]}}, "errors": {}})

    @unittest.skipUnless(os.environ.get("CLESD"), "this build has no clesd")
    def test_a_plain_node_beside_daemons_costs_little_and_counts_no_errors(self):
        plain = self.node("--name", "car1", "--rate", "0")
        for i in range(3):
            start_daemon(self, f"sat{i}")
        wait_until(lambda: plain.ask("PULL self:cles/peers").count('"node"') == 3, "all are known")
        time.sleep(3)  # until they have learned that it does not take part in gossip

        def counted():
            return json.loads(plain.ask("PULL self:cles/metrics"))

        before = counted()
        time.sleep(5)
        after = counted()
        asked = after["housekeeping"] - before["housekeeping"]
        longest = max(len(plain.ask(f"PULL self:{noun}")) for noun in ("cles", "cles/peers"))
        rate = asked * (longest + 200) / 5  # including the time of the requests
        print(f"a plain node beside three daemons: {asked} questions in 5 s, at most {rate:.0f} bytes a second")
        self.assertLessEqual(rate, 1000)
        self.assertEqual((after["errors"], after["errors_unsent"]), (0, 0))
        self.assertEqual(after["requests"]["PULL"] - before["requests"]["PULL"], 1)

    def test_pools_do_not_mix(self):
        north = [self.node("--name", name, "--pool", "north") for name in ("car1", "car2")]
        south = self.node("--name", "car1", "--pool", "south")
        plain = self.node("--name", "car3")
        wait_until(lambda: '"car2"' in north[0].ask("PULL self:cles/peers"), "those of a pool know each other")
        self.assertIn('"pool":"north"', north[0].ask("PULL self:cles"))
        self.assertNotIn("pool", plain.ask("PULL self:cles"))
        for node, others in ((north[1], ["car1"]), (south, []), (plain, [])):
            wait_until(lambda: '"announcements_foreign":0,' not in node.ask("PULL self:cles/metrics"), "others are heard")

            def known(node=node):
                return [p["node"] for p in json.loads(node.ask("PULL self:cles/peers"))["peers"]]
            wait_until(lambda: len(known()) >= len(others), "those of its pool are known")
            self.assertEqual(known(), others)
        self.assertIsNone(south.process.poll())


if __name__ == "__main__":
    unittest.main()
