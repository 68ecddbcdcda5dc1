#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Nodes that are discovered by name: `cles ls`, and the other commands without --at. On loopback, with a separate group
port for the tests."""

import json
import signal
import unittest

from support import PATIENCE, Node, cles, environment, finish, free_port, read_line, start, wait_until


def told(process, text):
    """The line of a node's log that reports it."""
    while line := read_line(process, process.stderr):
        if text in line:
            return line
    raise AssertionError(f"it ended, and did not say '{text}'")


PORT = free_port()
GROUP = f"lo,239.255.25.37:{PORT}"
ENVIRONMENT = environment(CLES_MULTICAST=GROUP)


def by_name(*arguments, **options):
    return cles(*arguments, env=ENVIRONMENT, **options)


class Group(unittest.TestCase):
    NODES = (("--name", "car1"), ("--name", "car2"))

    @classmethod
    def setUpClass(cls):
        cls.nodes = [Node(*arguments, "--multicast", GROUP) for arguments in cls.NODES]

    @classmethod
    def tearDownClass(cls):
        codes = [node.stop() for node in cls.nodes]
        if any(codes):
            raise AssertionError(f"nodes ended with {codes}")

    def ok(self, *arguments, **options):
        code, out, err = by_name(*arguments, **options)
        self.assertEqual((code, err), (0, ""), out)
        return out

    def peers(self, *arguments):
        return json.loads(self.ok("ls", "-o", "json", *arguments))["peers"]


class Found(Group):
    def test_requests_go_by_name(self):
        for name in ("car1", "car2"):
            self.assertEqual(self.ok("pull", f"{name}:echo/x"), '{"parameters":["x"]}\n')
            self.assertEqual(self.ok("push", f"{name}:echo", "-d", '{"a":1}'), '{"a":1}\n')
            self.assertEqual(self.ok("delegate", f"{name}:echo", "-d", "[1]"), "[1]\n")
            self.assertEqual(json.loads(self.ok("info", name, "-o", "json"))["node"], name)
            self.assertEqual(len(self.ok("bind", f"{name}:localization", "-n", "2", "-o", "raw").splitlines()), 2)
        self.assertEqual(self.ok("update", "car1:notice", "-d", "{}"), "{}\n")

    def test_ping_says_where(self):
        self.assertTrue(self.ok("ping", "car1", "-n", "1").startswith(f"PING car1 ({self.nodes[0].url}): "))

    def test_ls(self):
        peers = self.peers()
        self.assertEqual([p["node"] for p in peers], ["car1", "car2"])
        for peer, node in zip(peers, self.nodes):
            self.assertEqual(peer["endpoints"], [node.url, node.unix])
            self.assertEqual(peer["state"], "live")
            self.assertEqual(peer["load"], {"queued": 0, "running": 0, "workers": 0})
            self.assertRegex(peer["epoch"], "^[0-9a-f]{8}$")
            self.assertLess(peer["age_ms"], PATIENCE * 1000)
            self.assertEqual(list(peer), ["node", "endpoints", "epoch", "age_ms", "state", "load"])

    def test_ls_as_a_table(self):
        lines = self.ok("ls", "-o", "table").splitlines()
        self.assertEqual(lines[0].split(), ["NODE", "STATE", "LOAD", "LAST", "SEEN", "ENDPOINTS"])
        self.assertRegex(lines[1], rf"^car1  live +0 +.* ago +{self.nodes[0].url} {self.nodes[0].unix}$")
        self.assertEqual(len(lines), 3)

    def test_ls_with_tasks(self):
        for peer in self.peers("-l"):
            self.assertIn({"verb": "PULL", "task": "echo"}, [{k: t[k] for k in ("verb", "task")} for t in peer["tasks"]])
        table = self.ok("ls", "-l", "-o", "table")
        self.assertIn("localization (PULL BIND)", table.splitlines()[1])

    def test_ls_shows_load(self):
        working = start("delegate", "car1:sleep/60000", "-t", "60s", env=ENVIRONMENT)
        try:
            wait_until(lambda: self.peers()[0]["load"]["running"] == 1, "car1 tells of its work")
            self.assertRegex(self.ok("ls", "-o", "table").splitlines()[1], r"^car1  live +1 ")
        finally:
            working.send_signal(signal.SIGINT)
            self.assertEqual(finish(working)[0], 130)

    def test_ls_of_who_offers_a_task(self):
        for task in ("localization", "pull:localization", "BIND:localization"):
            self.assertEqual([p["node"] for p in self.peers("--offers", task)], ["car1", "car2"])
        peers = self.peers("--offers", "echo", "-l")
        self.assertIn("tasks", peers[0])
        self.assertNotIn("tasks", self.peers("--offers", "echo")[0])
        for task in ("primes", "push:localization"):  # no node does, but nodes exist
            self.assertEqual(self.peers("--offers", task), [])

    def test_a_node_tells_whom_it_knows(self):
        wait_until(lambda: len(self.peers("--at", self.nodes[0].url)) == 2, "car1 hears of car2")
        peers = self.peers("--at", self.nodes[0].url)
        self.assertEqual([p["node"] for p in peers], ["car1", "car2"])
        for peer in peers:
            self.assertEqual(peer["load"]["queued"], 0)
        self.assertEqual(json.loads(self.ok("pull", "car1:cles/peers"))["peers"][0]["node"], "car2")

    def test_nobody_of_that_name(self):
        code, out, err = by_name("pull", "car9:echo")
        self.assertEqual((code, out), (3, ""))
        first, second = err.splitlines()
        self.assertRegex(first, r"^cles: no_target: cles-\d+ cannot find 'car9': no node with that name has announced "
                                r"itself on lo; give its URL$")
        self.assertEqual(second, "cles: cles ls lists the nodes; --at URL or --peer NAME=URL sets the address of another one")

    def test_self_is_who_listens_at_the_default_address(self):
        code, _, err = by_name("pull", "self:cles", "--at", self.nodes[1].url)
        self.assertEqual((code, err), (0, ""))

    def test_what_says_where_needs_no_group(self):
        # Joining a group that cannot be joined would be an error.
        env = environment(CLES_MULTICAST="nowhere0")
        node = self.nodes[0]
        for place in (("--at", node.url), ("--peer", f"car1={node.unix}")):
            code, out, err = cles("pull", "car1:echo", *place, env=env)
            self.assertEqual((code, out, err), (0, '{"parameters":[]}\n', ""))
        code, _, err = cles("pull", "car1:echo", env=env)
        self.assertEqual(code, 1, err)
        self.assertIn("nowhere0", err)


class Alone(unittest.TestCase):
    def test_nobody_is_there(self):
        empty = environment(CLES_MULTICAST=f"lo,239.255.25.38:{free_port()}")
        code, out, err = cles("ls", "-o", "json", env=empty)
        self.assertEqual((code, out), (0, '{"peers":[]}\n'))
        self.assertEqual(err, "cles: no node has announced itself on lo; --multicast selects other interfaces\n")

    def test_without_multicast(self):
        for options in ({"env": environment(CLES_MULTICAST="off")}, {"env": ENVIRONMENT}):
            code, out, err = cles("ls", "--multicast", "off", **options)
            self.assertEqual((code, out), (2, ""))
            self.assertIn("--multicast IFACE", err)

    def test_a_node_off_the_group_is_not_listed(self):
        node = Node("--multicast", "off")
        try:
            code, out, _ = by_name("ls", "-o", "json")
            self.assertEqual(code, 0)
            self.assertEqual(json.loads(out)["peers"], [])
        finally:
            self.assertEqual(node.stop(), 0)

    def test_bad_values(self):
        for text in ("lo,", "lo,1.2.3.4", "lo,239.255.25.37:0", "lo,239.255.25.37:x", "lo,239.255.25.37:1:2"):
            code, out, err = cles("ls", "-m", text)
            self.assertEqual((code, out), (2, ""), text)
            self.assertTrue(err.startswith("cles: "), err)


class Lives(unittest.TestCase):
    def setUp(self):
        self.env = environment(CLES_MULTICAST=f"lo,239.255.25.39:{free_port()}")

    def names(self):
        return [(p["node"], p["state"]) for p in json.loads(cles("ls", "-o", "json", env=self.env)[1])["peers"]]

    def serve(self, name, *arguments):
        process = start("serve", "--name", name, "--listen", "tcp://127.0.0.1:0", *arguments, env=self.env)
        read_line(process)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def test_one_that_stops_takes_its_leave(self):
        node = self.serve("car1")
        watcher = self.serve("car2")
        told(watcher, "discovered car1")
        node.send_signal(signal.SIGTERM)
        told(watcher, "car1 has left")
        self.assertEqual(self.names(), [("car2", "live")])

    def test_one_that_is_killed_and_started_again_elsewhere_is_found_again(self):
        first = self.serve("car1")
        watcher = self.serve("car2")
        told(watcher, "discovered car1")
        first.kill()
        second = self.serve("car1")
        told(watcher, "car1 is now at")
        self.assertEqual(self.names(), [("car1", "live"), ("car2", "live")])
        self.assertIsNone(second.poll())

    def test_two_of_one_name_are_shown(self):
        first = self.serve("car1", "--allow-clash")
        second = self.serve("car1", "--allow-clash")
        for one in (first, second):
            self.assertIn("WARNING", told(one, "another node also has the name 'car1'").upper())
        code, out, err = cles("ls", "-w", "3s", "-o", "json", env=self.env)
        self.assertEqual((code, err), (0, ""))
        self.assertEqual([(p["node"], p["state"]) for p in json.loads(out)["peers"]],
                         [("car1", "live"), ("car1", "clash")])


if __name__ == "__main__":
    unittest.main()
