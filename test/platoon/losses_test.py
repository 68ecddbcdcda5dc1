#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A platoon as its users run it, each vehicle a process: one of them, or the observer, is killed or interrupted."""

import os
import signal
import unittest

from processes import PATIENCE, DriveTest, children_of, ended, free_group, is_running, read_until, start, wait_until


class Killed(DriveTest):
    def test_the_leader_is_killed(self):
        found = self.drive("--vehicles", 4, "--seconds", 10, "--vanish", "0@0.5", "--no-radar")
        self.assertFalse(found["steady"])
        self.assertIn("gone", self.modes(found, "v0"))
        self.assertIn("fallback", self.modes(found, "v1"))
        for vehicle in ("v1", "v2", "v3"):
            self.assertLess(self.speed(found, vehicle), 1, found["events"])

    def test_one_in_the_middle_is_killed(self):
        found = self.drive("--vehicles", 5, "--seconds", 5, "--vanish", "2@1", "--no-radar")
        self.assertIn("fallback", self.modes(found, "v3"))
        self.assertIn("v2 ahead is silent", [e["why"] for e in found["events"]])
        for vehicle in ("v3", "v4"):  # which brake, while the leader does not yet
            self.assertLess(self.speed(found, vehicle), 18, found["events"])
        for vehicle in ("v0", "v1"):
            self.assertGreater(self.speed(found, vehicle), 24, found["events"])

    def test_with_radars_those_behind_stop_behind_it(self):
        found = self.drive("--vehicles", 4, "--seconds", 13, "--vanish", "1@0.5")
        self.assertIn("radar", self.modes(found, "v2"))
        for vehicle in ("v2", "v3"):
            self.assertNotIn("fallback", self.modes(found, vehicle))
            self.assertLess(self.speed(found, vehicle), 2, found["events"])

    def test_the_last_is_killed(self):
        found = self.drive("--vehicles", 3, "--seconds", 4, "--vanish", "2@1")
        self.assertIn("gone", self.modes(found, "v2"))
        for vehicle in ("v0", "v1"):
            self.assertGreater(self.speed(found, vehicle), 24, found["events"])

    def test_the_watcher_is_killed_and_nothing_is_left(self):
        watcher = start("run", "--multicast", free_group(), "--vehicles", 3, "--seconds", 60)
        self.addCleanup(watcher.stderr.close)
        self.addCleanup(watcher.stdout.close)
        wait_until(lambda: len(children_of(watcher.pid)) == 3, "its vehicles are there")
        vehicles = children_of(watcher.pid)
        watcher.kill()
        watcher.wait()
        wait_until(lambda: not any(map(is_running, vehicles)), "its vehicles end")

    def test_the_watcher_is_killed_while_its_vehicles_start(self):
        """Until it runs its own program, a vehicle has the watcher's handlers of signals. SIGTERM ends it all the same."""
        for _ in range(20):
            watcher = start("run", "--multicast", free_group(), "--vehicles", 3, "--seconds", 60)
            vehicles = []
            while len(vehicles) < 3 and watcher.poll() is None:
                vehicles = children_of(watcher.pid)
            self.assertEqual(len(vehicles), 3)
            watcher.kill()
            watcher.communicate()
            wait_until(lambda those=vehicles: not any(map(is_running, those)), "its vehicles end")

    def test_interrupted_it_ends_well(self):
        watcher = start("run", "--multicast", free_group(), "--vehicles", 2, "--seconds", 60, start_new_session=True)
        self.addCleanup(ended, watcher)
        for _ in range(3):  # after which they have received each other
            read_until(watcher, r"\d s  2 vehicles")
        vehicles = children_of(watcher.pid)
        os.killpg(watcher.pid, signal.SIGINT)  # as a terminal does
        out, err = watcher.communicate(timeout=PATIENCE)
        self.assertEqual((watcher.returncode, err), (4, ""))  # the manoeuvre did not end
        self.assertRegex(out, r"(?m)^spacing   \d")  # no vehicle has left early
        self.assertRegex(out, r"(?m)^latency   p50 \d")
        self.assertFalse(any(map(is_running, vehicles)))


if __name__ == "__main__":
    unittest.main()
