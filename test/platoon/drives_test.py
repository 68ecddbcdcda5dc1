#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A platoon as its users run it, each vehicle a process: what vehicles receive from each other, joining, leaving."""

import json
import os
import subprocess
import tempfile
import unittest

from processes import PATIENCE, PLATOON, DriveTest, ended, environment, read_until
from two_hosts import Hosts


class Drive(DriveTest):
    def test_vehicles_hear_each_other_and_keep_their_distance(self):
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "record.json")
            found = self.drive("--vehicles", 4, "--hz", 50, "--seconds", 7, "--record", file)
            with open(file, encoding="utf-8") as record:
                self.assertEqual(json.load(record), found)
        self.assertTrue(found["steady"], found["events"])
        self.assertGreater(found["verdict"]["error"][0], 0.01)  # it brakes, so that there is an error
        self.assertLess(max(found["verdict"]["error"]), 2)
        self.assertGreater(found["latency"]["count"], 4 * 50)
        self.assertGreater(found["latency"]["p50_us"], 0)
        self.assertLess(found["latency"]["p50_us"], 100_000)
        self.assertEqual((found["missed"], found["relayed"], found["lost"]), (0, 0, 0))

    def test_one_joins_at_the_end(self):
        found = self.drive("--vehicles", 4, "--seconds", 10, "--join", "3@0.5")
        course = next(c for c in found["courses"] if c["vehicle"] == "v3")
        self.assertIsNone(course["error"][0])
        errors = [e for e in course["error"] if e is not None]
        self.assertGreater(max(errors), 15)
        self.assertLess(abs(errors[-1]), max(errors) - 4)  # it catches up gradually

    def test_one_leaves_and_the_gap_is_closed(self):
        found = self.drive("--vehicles", 4, "--seconds", 9, "--leave", "2@0.5")
        self.assertIn("left", self.modes(found, "v2"))
        self.assertIsNone(self.speed(found, "v2"))
        errors = next(c for c in found["courses"] if c["vehicle"] == "v3")["error"]
        gap = max(e for e in errors if e is not None)
        self.assertGreater(gap, 10)
        self.assertLess(abs(errors[-1]), gap - 5)


class TwoHosts(unittest.TestCase):
    def at(self, host, *arguments):
        return subprocess.Popen([*self.hosts.inside(host), PLATOON, *map(str, arguments)], stdin=subprocess.DEVNULL,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment())

    def test_one_joins_from_another_host(self):
        self.hosts = Hosts()
        self.addCleanup(self.hosts.close)
        refused = self.at(self.hosts.near, "run", "--multicast", "v0")
        self.addCleanup(ended, refused)
        self.assertRegex(refused.communicate(timeout=PATIENCE)[1],
                         r"^cles-platoon: multicast on 'v0' can be reached from other hosts, .*\(--insecure\)\n$")
        watcher = self.at(self.hosts.near, "run", "--multicast", "v0", "--insecure", "--vehicles", 2, "--seconds", 60,
                          "--leave", "1@1")
        self.addCleanup(ended, watcher)
        read_until(watcher, r"\d s  2 vehicles")
        joins = self.at(self.hosts.far, "vehicle", "--join", "--name", "v9", "--multicast", "v1", "--insecure", "--seconds", 3,
                        "--report")
        self.addCleanup(ended, joins)
        out, err = joins.communicate(timeout=PATIENCE)
        self.assertEqual(joins.returncode, 0, err)
        self.assertGreater(json.loads(out)["received"], 10, err)
        read_until(watcher, r"s  v1  left: ended normally$")


if __name__ == "__main__":
    unittest.main()
