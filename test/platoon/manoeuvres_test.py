#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A platoon as its users run it, each vehicle a process: one merges in the middle, while the last splits off."""

import unittest

from processes import DriveTest


class Manoeuvres(DriveTest):
    def test_one_merges_and_the_last_splits_off(self):
        found = self.drive("--vehicles", 4, "--seconds", 15, "--brake-at", 100, "--merge", "1@0.1", "--split", "3@0.3")
        told = [event["why"] for event in found["events"]]
        self.assertIn("it changes into the lane behind v1", told, found["events"])
        self.assertIn("it splits off", told)
        self.assertGreater(found["verdict"]["least_gap"], 7)
        course = {each["vehicle"]: each for each in found["courses"]}
        self.assertIsNone(next(d for d in course["v4"]["place"]))  # it is not there, or in the next lane
        places = [course[vehicle]["place"][-1] for vehicle in ("v0", "v1", "v4", "v2", "v3")]
        self.assertEqual(places, sorted(places, reverse=True))
        self.assertLess(course["v4"]["distance"][-1], 18)
        self.assertGreater(course["v3"]["distance"][-1], 25)
        self.assertLess(abs(course["v1"]["error"][-1]), 0.5)


if __name__ == "__main__":
    unittest.main()
