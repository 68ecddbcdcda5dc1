#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Nodes on two hosts discover each other by name, over a separate cable."""

import json
import re
import unittest

from support import PATIENCE, read_line, wait_until
from two_hosts import Hosts


class TwoHosts(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.hosts = Hosts()
        cls.addClassCleanup(cls.hosts.close)

    def start(self, host, *arguments):
        return self.hosts.start(self, host, "v0" if host == self.hosts.near else "v1", *arguments)

    def serve(self, host, name, *listen, more=()):
        process = self.start(host, "serve", "--name", name, "--insecure", *more, *[f"--listen={url}" for url in listen])
        said = [read_line(process) for _ in listen]
        return process, [re.search(r":(\d+)$", line).group(1) for line in said if "tcp" in line]

    def run_at(self, host, *arguments):
        process = self.start(host, *arguments)
        out, err = process.communicate(timeout=PATIENCE)
        return process.returncode, out, err

    def peers_of(self, host):
        code, out, err = self.run_at(host, "ls", "-o", "json")
        self.assertEqual(code, 0, err)
        return json.loads(out)["peers"]

    def states_known_to(self, node):
        code, out, err = self.run_at(self.hosts.near, "pull", f"{node}:cles/peers", "-o", "json")
        self.assertEqual(code, 0, err)
        return {p["node"]: p["state"] for p in json.loads(out)["peers"]}

    def test_a_name_reaches_the_other_host(self):
        _, (port,) = self.serve(self.hosts.near, "car1", "tcp://0.0.0.0:0")
        code, out, err = self.run_at(self.hosts.far, "pull", "car1:localization", "-o", "json")
        self.assertEqual((code, err), (0, ""))
        self.assertIn("velocity", json.loads(out))
        self.assertEqual([(p["node"], p["endpoints"]) for p in self.peers_of(self.hosts.far)],
                         [("car1", [f"tcp://10.77.0.1:{port}"])])
        code, out, err = self.run_at(self.hosts.far, "bind", "car1:localization", "-n", "3", "-o", "raw")
        self.assertEqual((code, len(out.splitlines()), err), (0, 3, ""))

    def test_addresses_are_those_of_use_where_one_asks(self):
        _, (_, port) = self.serve(self.hosts.near, "car6", "unix://@car6", "tcp://127.0.0.1:0", "tcp://0.0.0.0:0")
        self.serve(self.hosts.near, "car7", "tcp://127.0.0.1:0")
        at = f"tcp://10.77.0.1:{port}"

        def info(host, *arguments):
            code, out, err = self.run_at(host, "info", "--at", at, *arguments)
            self.assertEqual((code, err), (0, ""))
            return out

        self.assertEqual(json.loads(info(self.hosts.far, "-o", "json"))["endpoints"][0], at)
        self.assertIn(f"endpoints  {at}\n", info(self.hosts.far, "-o", "table"))
        self.assertIn(f"tcp://0.0.0.0:{port}", info(self.hosts.far, "-o", "raw"))  # as received
        self.assertIn(f"tcp://0.0.0.0:{port}", info(self.hosts.near, "-o", "table"))
        listed = {}

        def knows_both():
            code, out, err = self.run_at(self.hosts.far, "ls", "--at", at, "-l", "-o", "json")
            self.assertEqual((code, err), (0, ""))
            listed.update({p["node"]: p for p in json.loads(out)["peers"]})
            return "car7" in listed

        wait_until(knows_both, "car6 knows of car7")
        self.assertEqual(listed["car6"]["endpoints"][0], at)
        self.assertIn("tasks", listed["car6"])
        self.assertEqual(listed["car7"]["endpoints"], [])  # the loopback there is not the one here
        self.assertIn("no address", listed["car7"]["failure"])

    def test_what_others_cannot_reach_is_not_announced(self):
        _, ports = self.serve(self.hosts.near, "car2", "tcp://127.0.0.1:0", "tcp://10.77.0.1:0", "unix://@car2")
        self.assertEqual([p["endpoints"] for p in self.peers_of(self.hosts.far)], [[f"tcp://10.77.0.1:{ports[1]}"]])

    def test_one_that_nobody_can_reach_is_there_all_the_same(self):
        self.serve(self.hosts.near, "car3", "tcp://127.0.0.1:0")
        self.assertEqual([(p["node"], p["endpoints"]) for p in self.peers_of(self.hosts.far)], [("car3", [])])
        code, out, err = self.run_at(self.hosts.far, "pull", "car3:echo")
        self.assertEqual((code, out), (3, ""))
        self.assertIn("it has announced no address that is reachable from here", err)

    def test_one_that_dies_is_suspect_and_another_run_of_it_found_again(self):
        self.serve(self.hosts.near, "watcher", "tcp://0.0.0.0:0")
        first, _ = self.serve(self.hosts.far, "car4", "tcp://0.0.0.0:0")
        wait_until(lambda: self.states_known_to("watcher") == {"car4": "live"}, "car4 is heard")
        first.kill()
        wait_until(lambda: self.states_known_to("watcher") == {"car4": "suspect"}, "car4 is suspect")
        _, (port,) = self.serve(self.hosts.far, "car4", "tcp://0.0.0.0:0")
        wait_until(lambda: self.states_known_to("watcher") == {"car4": "live"}, "car4 is heard again")
        code, out, err = self.run_at(self.hosts.near, "pull", "car4:cles", "-o", "json")
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(json.loads(out)["endpoints"], [f"tcp://0.0.0.0:{port}"])

    def test_two_of_one_name_on_two_hosts_are_reported(self):
        near, _ = self.serve(self.hosts.near, "car5", "tcp://0.0.0.0:0", more=["--allow-clash"])
        far, _ = self.serve(self.hosts.far, "car5", "tcp://0.0.0.0:0", more=["--allow-clash"])
        for process, other in ((near, "10.77.0.2"), (far, "10.77.0.1")):
            while line := read_line(process, process.stderr):
                if f"another node also has the name 'car5', on {other}" in line:
                    break
            self.assertTrue(line, "it was not said")

    def test_beyond_loopback_it_has_to_be_asked_for(self):
        code, _, err = self.run_at(self.hosts.near, "serve", "--listen", "tcp://127.0.0.1:0")
        self.assertEqual(code, 2)
        self.assertIn("insecure", err)


if __name__ == "__main__":
    unittest.main()
