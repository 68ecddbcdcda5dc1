#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A platoon as its users run it, each vehicle a process: what vehicles receive from each other, joining, leaving."""

import json
import math
import os
import re
import subprocess
import tempfile
import time
import unittest

from processes import PATIENCE, PLATOON, DriveTest, ended, environment, free_group, start
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

    def test_what_is_lost_on_purpose_is_lost(self):
        found = self.drive("--vehicles", 3, "--hz", 50, "--seconds", 3, "--loss", 20, "--delay", 20)
        self.assertAlmostEqual(found["lost"] / (found["relayed"] + found["lost"]), 0.2, delta=0.06)
        # The nodes themselves report it. An update that another one overtakes is missing, too.
        self.assertAlmostEqual(found["missed"] / (found["received"] + found["missed"]), 0.2, delta=0.1)
        self.assertGreater(found["latency"]["p50_us"], 10_000)

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

    def test_without_any_update_they_follow_by_radar(self):
        found = self.drive("--vehicles", 3, "--hz", 50, "--seconds", 5, "--loss", 100)
        self.assertEqual((found["relayed"], found["received"]), (0, 0))
        for vehicle in ("v1", "v2"):
            self.assertIn("radar", self.modes(found, vehicle), found["events"])
            self.assertGreater(self.speed(found, vehicle), 20)
        self.assertGreater(found["verdict"]["least_gap"], 9)

    def test_vehicles_may_differ_and_lose_in_bursts(self):
        found = self.drive("--vehicles", 4, "--hz", 50, "--seconds", 7, "--loss", 10, "--burst", 4, "--lags", 0.2, 0.5,
                           "--brakes", 5.5, 8)
        self.assertEqual(found["burst"], 4)
        self.assertAlmostEqual(found["missed"] / (found["received"] + found["missed"]), 0.1, delta=0.08)
        self.assertGreater(found["verdict"]["least_gap"], 8)
        leader = next(c for c in found["courses"] if c["vehicle"] == "v0")  # its road begins at an angle of 30 degrees
        degrees = leader["lat"][-1] - leader["lat"][0]
        driven = leader["place"][-1] - leader["place"][0]
        self.assertGreater(driven, 50)
        self.assertAlmostEqual(degrees * 111200 / math.cos(math.radians(30)), driven, delta=0.01 * driven)


class Others(unittest.TestCase):
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
        self.assertRegex(watcher.stdout.readline(), r"\d s  2 vehicles")
        joins = self.at(self.hosts.far, "vehicle", "--join", "--name", "v9", "--multicast", "v1", "--insecure", "--seconds", 3,
                        "--report")
        self.addCleanup(ended, joins)
        out, err = joins.communicate(timeout=PATIENCE)
        self.assertEqual(joins.returncode, 0, err)
        self.assertGreater(json.loads(out)["received"], 10, err)
        self.read_until(watcher, r"s  v1  left: ended normally$")

    def read_until(self, process, expression):
        """The first of the next lines that contains it."""
        for line in process.stdout:
            if re.search(expression, line):
                return line
        raise AssertionError(f"it ended: {process.stderr.read()}")

    def test_vehicles_of_another_host_count_and_are_watched(self):
        self.hosts = Hosts()
        self.addCleanup(self.hosts.close)
        far = ["--multicast", "v1", "--insecure", "--brake-at", 3, "--slow", 22, "--slow-for", 0.5]
        start_ns = time.monotonic_ns() + 1_500_000_000
        start_utc = time.time() + 1.5
        for i in range(3):
            vehicle = self.at(self.hosts.far, "vehicle", "--name", f"far{i}", "--x", -15 * i, "--turn", i, "--turns", 3,
                              "--start-ns", start_ns, "--start-utc", start_utc,
                              *(["--ahead", f"far{i - 1}"] if i else ["--lead"]), *far)
            self.addCleanup(ended, vehicle)
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "record.json")
            watcher = self.at(self.hosts.near, "watch", "--multicast", "v0", "--insecure", "--record", file, "--seconds", 11)
            self.addCleanup(ended, watcher)
            self.read_until(watcher, r"\d s  3 vehicles, .*, 15\.00 m apart")
            said, err = watcher.communicate(timeout=PATIENCE)
            self.assertEqual((watcher.returncode, err), (0, ""))
            with open(file, encoding="utf-8") as record:
                found = json.load(record)
        self.assertRegex(said, r"(?m)^platoon   3 vehicles, watched for 1\d\.\d s\nspacing   0\.\d+ m off at most, behind far0; "
                               r"string ratio 0\.9\d+$")
        self.assertEqual([course["vehicle"] for course in found["courses"]], ["far0", "far1", "far2"])
        leader, follower = found["courses"][0], found["courses"][1]
        self.assertLess(min(a for a in leader["acceleration"] if a is not None), -2)
        self.assertLessEqual({"lead"}, set(leader["mode"]))
        self.assertIn("follow", follower["mode"])
        self.assertTrue(all(len(leader[name]) == len(found["t"]) for name in ("acceleration", "mode", "speed")))

    def test_a_drive_counts_those_that_others_have_started(self):
        group = free_group()
        watcher = start("run", "--multicast", group, "--vehicles", 2, "--seconds", 20)
        self.addCleanup(ended, watcher)
        self.assertRegex(watcher.stdout.readline(), r"\d s  2 vehicles")
        joins = start("vehicle", "--name", "v9", "--multicast", group, "--seconds", 60)
        self.addCleanup(ended, joins)
        self.read_until(watcher, r"\d s  3 vehicles")
        joins.kill()
        self.read_until(watcher, r"s  v9  silent$")


if __name__ == "__main__":
    unittest.main()
