#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`any:` and `all:` without an address: the command finds a node that routes."""

import json
import os
import subprocess
import tempfile
import unittest

from support import Node, cles, environment, finish, free_port, read_line

CLESD = os.environ.get("CLESD", "")


@unittest.skipUnless(CLESD, "clesd was not built")
class Router(unittest.TestCase):
    def setUp(self):
        self.group = f"lo,239.255.25.37:{free_port()}"
        self.env = environment(CLES_MULTICAST=self.group)
        car = Node("--multicast", self.group)
        self.addCleanup(car.stop)

    def start_daemon(self, name):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        config = os.path.join(folder.name, "clesd.yaml")
        with open(config, "w", encoding="utf-8") as file:
            file.write(f"node: {name}\nlisten: [tcp://127.0.0.1:0]\nworkers: 1\nplugins: [libcles-system.so]\n")
        daemon = subprocess.Popen([CLESD, "--config", config], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL, text=True, env=self.env)
        self.addCleanup(lambda: (daemon.terminate(), finish(daemon)))
        line = read_line(daemon)
        self.assertIn("listening", line)
        return line.split()[-1]

    def run_ok(self, *arguments):
        code, out, err = cles(*arguments, env=self.env)
        self.assertEqual((code, err), (0, ""), out)
        return [json.loads(line) for line in out.splitlines()]

    def test_one_that_is_known_is_asked(self):
        self.start_daemon("sat1")
        self.assertIn("seconds", self.run_ok("pull", "any:utc")[0])
        self.assertEqual(self.run_ok("push", "any:echo", "-d", '{"a":1}'), [{"a": 1}])  # which only car1 offers
        self.assertEqual(list(self.run_ok("pull", "all:utc")[0]["results"]), ["sat1"])
        self.assertEqual(len(self.run_ok("pull", "any:utc", "-n", "3", "-i", "0")), 3)

    def test_what_nobody_offers(self):
        self.start_daemon("sat1")
        code, out, err = cles("pull", "any:nothing", env=self.env)
        self.assertEqual((code, out), (3, ""), err)
        self.assertEqual(err, "cles: no_target: sat1: no known node offers PULL 'nothing'\n")  # a router has answered

    def test_whom_a_router_does_not_know(self):
        url = self.start_daemon("sat1")
        code, out, err = cles("pull", "car9:nothing", "--at", url, env=self.env)
        self.assertEqual((code, out), (3, ""), err)
        self.assertNotIn("give its URL", err)
        self.assertIn("PULL sat1:cles/peers lists the nodes that it knows\n", err)
        self.assertIn("cles: cles ls --at URL lists the nodes that the node there knows\n", err)

    def test_nobody_routes(self):
        code, out, err = cles("pull", "any:localization", env=self.env)
        self.assertEqual((code, out), (3, ""), err)
        self.assertIn("no_target: ", err)
        self.assertIn("clesd", err)


if __name__ == "__main__":
    unittest.main()
