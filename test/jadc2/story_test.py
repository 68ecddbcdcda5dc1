#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Joint command as its users run it, from the first frame to the strike: on loopback, on hosts that have only the links of
section 2.2, with an operator, and by the script.

    story_test.py PROGRAMS
"""

import json
import os
import subprocess
import sys
import unittest

from jadc2_fleet import Fleet
from story import StoryTest, namespaces

PROGRAMS = sys.argv[1]
SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "jadc2")


class Story(StoryTest):
    def test_from_the_first_frame_to_the_strike(self):
        with Fleet(PROGRAMS) as fleet:
            self.run_story(fleet)

    def test_with_only_the_links_that_there_are(self):
        with Fleet(PROGRAMS, namespaces(self)) as fleet:
            satellite, _, striker = self.run_story(fleet)
            self.assertTrue(fleet.reaches("recon", satellite.url))
            self.assertTrue(fleet.reaches("mission", striker.url))
            for role, daemon in (("mission", satellite), ("strike", satellite), ("recon", striker), ("satellite", striker)):
                self.assertFalse(fleet.reaches(role, daemon.url), f"from {role} to {daemon.name}")

    def test_an_operator_decides(self):
        with Fleet(PROGRAMS) as fleet:
            satellite, striker = fleet.satellite(), fleet.striker()
            recon = fleet.recon([satellite], "--fps", "30")
            audit = os.path.join(fleet.folder, "audit")
            mission = fleet.mission(recon, [striker], "--operator", "--audit", audit, stdin=subprocess.PIPE)

            def type_in(line):
                mission.process.stdin.write(line + "\n")
                mission.process.stdin.flush()

            mission.wait_for("picture")
            self.assertEqual(mission.all("decided"), [])  # only the operator does
            type_in("strike")
            mission.wait_for("operator", "'strike' is not an order")
            type_in("strike 999999")
            mission.wait_for("operator", "there is no target 999999 now")
            for words in ("confirm", "hold", "abort"):
                type_in(words)
                mission.wait_for("operator", f"there is no order to {words}")
            self.assertEqual(mission.all("decided"), [])  # nothing was read back
            decided = mission.order_by_hand()["data"]
            self.assertRegex(mission.all("read_back")[-1]["text"],
                             r"^strike target \d+, at .* seen by sat1 in frame \d+, \d+\.\d s ago: confirm, hold or abort$")
            self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
            self.assertEqual(mission.all("strike")[0]["data"]["target"], decided["target"])
            with open(audit, encoding="utf-8") as file:
                kept = [json.loads(line) for line in file]
            self.assertEqual(kept[0]["text"], "mission has no key; an operator decides")
            self.assertEqual([one["event"] for one in kept if one["event"] in ("decided", "strike", "assessed", "report")],
                             ["decided", "strike", "assessed", "report"])
            self.assertIn(mission.all("decided")[0]["text"], [one["text"] for one in kept])

            mission = fleet.mission(recon, [striker], "--operator", stdin=subprocess.PIPE)
            mission.wait_for("bound")
            type_in("quit")
            self.assertEqual(mission.end(), 3)
            self.assertEqual(len(striker.pull("strike1:strike")["orders"]), 1)

    def test_the_script_shows_it(self):
        for more in ([], ["--lose-satellite", "--spare"], ["--lose-satellite"]):
            done = subprocess.run([sys.executable, "-B", SCRIPT, "--programs", PROGRAMS, *more], stdin=subprocess.DEVNULL,
                                  capture_output=True, text=True, timeout=120, check=False)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            self.assertIn("each frame and each order has an outcome", done.stdout)
            if "--spare" in more or not more:
                self.assertRegex(done.stdout, r"data to decision +\d+\.\d{3} ms")
            if "--spare" in more:
                self.assertRegex(done.stdout, r"sat\d processes the video(?s:.*)sat\d is killed(?s:.*)sat\d processes the video")
            elif more:
                self.assertIn("no other node offers it", done.stdout)
                self.assertNotIn("data to decision", done.stdout)

    def test_the_script_says_what_it_lacks(self):
        done = subprocess.run([sys.executable, "-B", SCRIPT, "--programs", "/nowhere"], stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, timeout=30, check=False)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("there is no clesd in /nowhere", done.stderr)
        for more in (["--kbit", "64"], ["--hosts", "--kbit", "7"]):
            done = subprocess.run([sys.executable, "-B", SCRIPT, "--programs", PROGRAMS, *more], stdin=subprocess.DEVNULL,
                                  capture_output=True, text=True, timeout=30, check=False)
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertIn("--kbit: 8 at least, and it needs --hosts", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
