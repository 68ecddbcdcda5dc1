#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Joint command with 64 kbit/s between each aircraft and the mission centre, and with less.

    slow_link_test.py PROGRAMS
"""

import os
import signal
import subprocess
import sys
import unittest

from jadc2_fleet import Fleet, Namespaces
from story import namespaces

PROGRAMS = sys.argv[1]
SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "jadc2")
KBIT = 64


def lateness(picture):
    """Seconds from the time when a picture was published until the mission centre shows it."""
    return picture["utc"] - picture["data"]["published"]


class SlowLink(unittest.TestCase):
    def start(self, kbit):
        self.fleet = Fleet(PROGRAMS, namespaces(self, lambda: Namespaces(kbit))).__enter__()
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
        self.start(KBIT)
        mission = self.start_mission("--strikes", "2")
        shown = self.pictures(mission)
        for _ in range(6):
            self.assertLess(lateness(next(shown)), 1)
        for _ in range(2):
            mission.order_by_hand()
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        for strike in mission.all("strike"):
            self.assertEqual(strike["data"]["fate"], "done")
            self.assertLess(strike["data"]["tracks_way_ms"], 1000)
        # One of 200 misses (`jadc2.engagement`).
        self.assertTrue(any(one["data"]["hit"] and one["data"]["is_target"] for one in mission.all("assessed")),
                        mission.events)
        for ends in (("recon", "mission"), ("mission", "recon"), ("strike", "mission"), ("mission", "strike")):
            self.assertEqual(self.fleet.hosts.limits(*ends)["drops"], 0, ends)
        self.recon.stop(signal.SIGINT)
        self.assertEqual(self.recon.end(), 0)
        self.assertGreaterEqual(self.recon.all("report")[0]["data"]["recall"], 0.9)

    def test_what_does_not_fit_is_late(self):
        """Pictures of each frame, at a quarter of the rate."""
        self.start(KBIT // 4)
        mission = self.start_mission("--every", "0")
        late = next(picture for picture in self.pictures(mission) if lateness(picture) > 1)
        self.assertGreater(late["data"]["frame"], 0)
        self.assertGreater(self.fleet.hosts.limits("recon", "mission")["overlimits"], 0)
        mission.stop(signal.SIGINT)

    def test_the_script_shows_it(self):
        namespaces(self).close()  # or it is skipped
        done = subprocess.run([sys.executable, "-B", SCRIPT, "--programs", PROGRAMS, "--hosts", "--kbit", str(KBIT)],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=100, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("each frame and each order has an outcome", done.stdout)
        self.assertIn("is released by strike1", done.stdout)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
