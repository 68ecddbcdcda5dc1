#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Joint command with 64 kbit/s between each aircraft and the mission centre.

    slow_link_test.py PROGRAMS
"""

import signal
import subprocess
import sys
import unittest

from jadc2_fleet import Fleet, Namespaces
from story import namespaces

PROGRAMS = sys.argv[1]
KBIT = 64


def lateness(picture):
    """Seconds from the time when a picture was published until the mission centre shows it."""
    return picture["utc"] - picture["data"]["published"]


class SlowLink(unittest.TestCase):
    def setUp(self):
        self.fleet = Fleet(PROGRAMS, namespaces(self, lambda: Namespaces(KBIT))).__enter__()
        self.addCleanup(lambda: self.fleet.__exit__(None, None, None))
        self.recon = self.fleet.recon([self.fleet.satellite()], "--deadline", "20000")

    def start_mission(self, *arguments):
        return self.fleet.mission(self.recon, [self.fleet.striker()], "--operator", "--duration", "60", *arguments,
                                  stdin=subprocess.PIPE)

    @staticmethod
    def pictures(mission):
        """The pictures that the operator sees, one per second."""
        after = 0
        while True:
            picture = mission.wait_for("picture", after=after)
            after = mission.events.index(picture, after) + 1
            yield picture

    def test_pictures_are_not_late_and_a_strike_hits(self):
        mission = self.start_mission()
        shown = self.pictures(mission)
        for _ in range(6):
            self.assertLess(lateness(next(shown)), 1)
        mission.order_by_hand()
        self.assertEqual(mission.end(), 0, mission.events)
        strike, = mission.all("strike")
        self.assertEqual(strike["data"]["fate"], "done")
        self.assertLess(strike["data"]["tracks_way_ms"], 1000)
        assessed, = mission.all("assessed")
        self.assertTrue(assessed["data"]["hit"] and assessed["data"]["is_target"], assessed)
        used = self.fleet.hosts.limits("recon", "mission")
        self.assertGreater(used["bytes"], 0)
        self.assertEqual(used["drops"], 0)
        self.recon.stop(signal.SIGINT)
        self.assertEqual(self.recon.end(), 0)
        self.assertGreaterEqual(self.recon.all("report")[0]["data"]["recall"], 0.9)

    def test_a_picture_of_each_frame_would_be_too_much(self):
        mission = self.start_mission("--every", "0")
        late = next(picture for picture in self.pictures(mission) if lateness(picture) > 1)
        self.assertGreater(late["data"]["frame"], 0)
        mission.stop(signal.SIGINT)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
