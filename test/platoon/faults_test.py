#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A platoon whose vehicles are in network namespaces behind a relay, which loses and delays what they send."""

import math
import unittest

from processes import DriveTest


class Faults(DriveTest):
    def test_what_is_lost_on_purpose_is_lost(self):
        found = self.drive("--vehicles", 3, "--hz", 50, "--seconds", 3, "--loss", 20, "--delay", 20)
        self.assertAlmostEqual(found["lost"] / (found["relayed"] + found["lost"]), 0.2, delta=0.06)
        # The nodes themselves report it. An update that another one overtakes is missing, too.
        self.assertAlmostEqual(found["missed"] / (found["received"] + found["missed"]), 0.2, delta=0.1)
        self.assertGreater(found["latency"]["p50_us"], 10_000)

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

    def test_without_any_update_they_follow_by_radar(self):
        found = self.drive("--vehicles", 3, "--hz", 50, "--seconds", 5, "--loss", 100)
        self.assertEqual((found["relayed"], found["received"]), (0, 0))
        for vehicle in ("v1", "v2"):
            self.assertIn("radar", self.modes(found, vehicle), found["events"])
            self.assertGreater(self.speed(found, vehicle), 20)
        self.assertGreater(found["verdict"]["least_gap"], 9)


if __name__ == "__main__":
    unittest.main()
