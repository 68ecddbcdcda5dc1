#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Joint command as its users run it, from the first frame to the strike: on loopback, on hosts that have only the links of
section 2.2, with an operator, and by the script.

    story_test.py PROGRAMS
"""

import os
import signal
import subprocess
import sys
import unittest

from jadc2_fleet import PATIENCE, Fleet, Namespaces, Trouble

PROGRAMS = sys.argv[1]
SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "jadc2")
STEPS = ["encode_ms", "fmv_way_ms", "fmv_queue_ms", "fmv_run_ms", "publish_ms", "tracks_way_ms", "decide_ms"]


class Story(unittest.TestCase):
    def check_strike(self, strike):
        told = strike["data"]
        self.assertEqual((told["fate"], told["trouble"], told["struck_by"]), ("done", "", "strike1"))
        self.assertEqual(told["processed_by"], "sat1")
        for step in ("encode_ms", "fmv_way_ms", "fmv_run_ms", "strike_way_ms", "strike_run_ms"):
            self.assertGreater(told[step], 0, step)
        for step in ("fmv_queue_ms", "strike_queue_ms"):
            self.assertGreaterEqual(told[step], 0, step)
        self.assertAlmostEqual(sum(told[step] for step in STEPS), told["data_to_decision_ms"], 2)
        self.assertGreater(told["data_to_answer_ms"], told["data_to_decision_ms"])
        return told

    def run_story(self, fleet):
        satellite, striker = fleet.satellite(), fleet.striker()
        # Frames must not fail on a busy machine. Under a sanitizer most would be skipped, and too few of them evaluated.
        recon = fleet.recon([satellite], "--fps", "30" if PATIENCE <= 30 else "6", "--deadline", "20000")
        mission = fleet.mission(recon, [striker], "--strikes", "2", "--duration", "60")
        self.assertEqual(mission.end(), 0, mission.events)
        strikes = [self.check_strike(strike) for strike in mission.all("strike")]
        self.assertEqual(len(strikes), 2)
        self.assertEqual(len(mission.all("assessed")), 2)
        self.assertTrue(all(one["data"]["missed_by"] < 320 for one in mission.all("assessed")))

        # The outcome of each job, at both of its ends.
        self.assertEqual(mission.all("report")[0]["data"],
                         {"given": 2, "done": 2, "refused": 0, "failed": 0, "unknown": 0, "open": 0})
        self.assertEqual(striker.pull("strike1:strike")["orders"], sorted(told["order"] for told in strikes))
        recon.stop(signal.SIGINT)
        self.assertEqual(recon.end(), 0)
        report = recon.all("report")[0]["data"]
        frames = report["frames"]
        self.assertEqual(frames["captured"], frames["done"] + frames["failed"] + frames["skipped"])
        self.assertEqual(frames["nodes"], ["sat1"], frames)
        self.assertLessEqual(set(frames["failures"]), {"no_target"}, recon.events)  # before it was found
        self.assertEqual(satellite.pull("sat1:FMV_Processing")["frames"], frames["done"])
        self.assertGreater(report["judged"], 0)
        self.assertGreater(report["recall"], 0)

        # No node knows others than those of its links.
        self.assertEqual(satellite.peers(), set())
        self.assertEqual(striker.peers(), set())
        return satellite, recon, striker

    def test_from_the_first_frame_to_the_strike(self):
        with Fleet(PROGRAMS) as fleet:
            self.run_story(fleet)

    def test_with_only_the_links_that_there_are(self):
        try:
            hosts = Namespaces()
        except Trouble as no_way:
            if os.environ.get("CI") == "true" and os.geteuid() == 0:
                raise
            self.skipTest(str(no_way))
        with Fleet(PROGRAMS, hosts) as fleet:
            satellite, _, striker = self.run_story(fleet)
            self.assertTrue(fleet.reaches("recon", satellite.url))
            self.assertTrue(fleet.reaches("mission", striker.url))
            for role, daemon in (("mission", satellite), ("strike", satellite), ("recon", striker), ("satellite", striker)):
                self.assertFalse(fleet.reaches(role, daemon.url), f"from {role} to {daemon.name}")

    def test_an_operator_decides(self):
        with Fleet(PROGRAMS) as fleet:
            satellite, striker = fleet.satellite(), fleet.striker()
            recon = fleet.recon([satellite], "--fps", "30")
            mission = fleet.mission(recon, [striker], "--operator", stdin=subprocess.PIPE)

            def type_in(line):
                mission.process.stdin.write(line + "\n")
                mission.process.stdin.flush()

            mission.wait_for("picture")
            self.assertEqual(mission.all("decided"), [])  # only the operator does
            type_in("strike")
            mission.wait_for("operator", "'strike' is not an order")
            type_in("strike 999999")
            mission.wait_for("operator", "there is no target 999999 now")
            decided = mission.order_by_hand()["data"]
            self.assertEqual(mission.end(), 0, mission.events)
            self.assertEqual(mission.all("strike")[0]["data"]["target"], decided["target"])

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


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
