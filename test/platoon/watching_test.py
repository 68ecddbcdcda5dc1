#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Who is there, as an observer sees it: vehicles of another host, and those that somebody else has started."""

import json
import os
import subprocess
import tempfile
import time
import unittest

from processes import PATIENCE, PLATOON, ended, environment, free_group, read_until, start
from two_hosts import Hosts


class Watching(unittest.TestCase):
    def at(self, host, *arguments):
        process = subprocess.Popen([*self.hosts.inside(host), PLATOON, *map(str, arguments)], stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment())
        self.addCleanup(ended, process)
        return process

    def test_vehicles_of_another_host_count_and_are_watched(self):
        self.hosts = Hosts()
        self.addCleanup(self.hosts.close)
        far = ["--multicast", "v1", "--insecure", "--brake-at", 3, "--slow", 22, "--slow-for", 0.5]
        start_ns = time.monotonic_ns() + 1_500_000_000
        start_utc = time.time() + 1.5
        for i in range(3):
            self.at(self.hosts.far, "vehicle", "--name", f"far{i}", "--x", -15 * i, "--turn", i, "--turns", 3, "--start-ns", start_ns,
                    "--start-utc", start_utc, *(["--ahead", f"far{i - 1}"] if i else ["--lead"]), *far)
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "record.json")
            watcher = self.at(self.hosts.near, "watch", "--multicast", "v0", "--insecure", "--record", file, "--seconds", 11)
            read_until(watcher, r"\d s  3 vehicles, .* m apart")
            said = watcher.stdout.read()
            self.assertEqual((watcher.wait(PATIENCE), watcher.stderr.read()), (0, ""), said)
            with open(file, encoding="utf-8") as record:
                found = json.load(record)
        self.assertRegex(said, r"(?m)^platoon   3 vehicles, watched for 1\d\.\d s\nspacing   0\.\d+ m off at most, behind far[01]; "
                               r"string ratio [01]\.\d+$")
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
        read_until(watcher, r"\d s  2 vehicles")
        joins = start("vehicle", "--name", "v9", "--multicast", group, "--seconds", 60)
        self.addCleanup(ended, joins)
        read_until(watcher, r"\d s  3 vehicles")
        joins.kill()
        read_until(watcher, r"s  v9  silent$")


if __name__ == "__main__":
    unittest.main()
