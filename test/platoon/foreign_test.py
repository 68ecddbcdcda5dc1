#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A platoon of old, new and foreign vehicles, as processes: what those of another make tell is enough."""

import json
import os
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from processes import PATIENCE, ended, environment, free_group, run, start, wait_until
from support import CLES

LEADER = Path(__file__).with_name("foreign_leader.py")


class Foreign(unittest.TestCase):
    def setUp(self):
        self.group = free_group()
        self.start_utc, self.start_ns = time.time() + 2, time.monotonic_ns() + 2_000_000_000

    def lead(self, brake_at, seconds):
        """v0, of another make."""
        states = subprocess.Popen([sys.executable, "-B", LEADER, *map(str, (self.start_utc, brake_at, seconds))],
                                  stdout=subprocess.PIPE)
        self.addCleanup(ended, states)
        node = subprocess.Popen([CLES, "publish", "v0:state"], stdin=states.stdout, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                text=True, env={**environment(), "CLES_MULTICAST": self.group})
        self.addCleanup(ended, node)

    def talk_nonsense(self):
        """In the same group, under the same noun."""
        node = subprocess.Popen([CLES, "publish", "x:state"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                text=True, env={**environment(), "CLES_MULTICAST": self.group})
        self.addCleanup(ended, node)
        self.addCleanup(node.stdin.close)
        node.stdin.write('{"mode":"car"}\n')
        node.stdin.flush()

    def follow(self, i, *more):
        vehicle = start("vehicle", "--name", f"v{i}", "--ahead", f"v{i - 1}", "--turn", i, "--turns", 4, "--multicast", self.group,
                        "--start-ns", self.start_ns, "--start-utc", f"{self.start_utc:.6f}", "--seconds", 14, "--report", *more)
        self.addCleanup(ended, vehicle)
        return vehicle

    def watched(self, seconds):
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "record.json")
            wait_until(lambda: time.time() > self.start_utc, "the drive begins")
            code, _, err = run("watch", "--multicast", self.group, "--seconds", seconds, "--record", file)
            self.assertIn(code, (0, 4), err)
            with open(file, encoding="utf-8") as record:
                return json.load(record)

    def test_old_and_new_vehicles_follow_a_leader_of_another_make(self):
        self.lead(3, 14)
        self.talk_nonsense()
        self.follow(1, "--x", -15, "--leader", "v0")
        self.follow(2, "--x", -30, "--dialect", "older")
        last = self.follow(3, "--x", -45)
        found = self.watched(11)
        self.assertEqual([course["vehicle"] for course in found["courses"]], ["v0", "v1", "v2", "v3"])
        self.assertTrue(found["verdict"]["ended"], found["events"])
        self.assertFalse(found["verdict"]["collision"])
        self.assertGreater(found["verdict"]["error"][0], 0.1)
        # Exact values are those of virtual time: here, a busy machine delays updates, and one drives by radar for a moment.
        modes = [mode for course in found["courses"][1:] for mode in course["mode"][60:]]
        self.assertGreater(modes.count("follow"), 0.8 * len(modes), found["events"])
        self.assertLess(found["verdict"]["string_ratio"], 1.2)
        out, err = last.communicate(timeout=PATIENCE)
        self.assertGreater(json.loads(out)["received"], 200, err)

    def test_who_does_not_know_the_leader_keeps_a_larger_distance(self):
        self.lead(9, 14)
        self.follow(1, "--x", -15)
        self.follow(2, "--x", -30)
        found = self.watched(10)
        first, second = found["courses"][1:3]
        self.assertIn("degraded", first["mode"])
        self.assertGreater(first["distance"][-1], 25)
        self.assertIn("follow", second["mode"])
        self.assertAlmostEqual(second["distance"][-1], 15, delta=3)

    def test_a_vehicle_tells_the_minimum_as_its_localization(self):
        self.lead(20, 6)
        self.follow(1, "--x", -15, "--leader", "v0")
        told = subprocess.run([CLES, "bind", "v1:localization", "-n", "2", "-o", "json"], capture_output=True, text=True,
                              env={**environment(), "CLES_MULTICAST": self.group}, timeout=PATIENCE, check=True).stdout
        self.assertEqual(set(json.loads(told.splitlines()[-1])), {"utc", "lat", "lon", "velocity", "acceleration"})


if __name__ == "__main__":
    unittest.main()
