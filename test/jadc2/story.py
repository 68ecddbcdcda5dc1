# SPDX-License-Identifier: BSL-1.0
"""A whole run of joint command, from the first frame to three strikes, and what has to be true of it."""

import os
import signal
import unittest

from jadc2_fleet import PATIENCE, Namespaces, Trouble

STEPS = ["encode_ms", "fmv_way_ms", "fmv_queue_ms", "fmv_run_ms", "publish_ms", "tracks_way_ms", "decide_ms"]


def namespaces(test, kind=Namespaces):
    """Hosts in namespaces of their own; skips the test where the system does not permit them."""
    try:
        return kind()
    except Trouble as no_way:
        if os.environ.get("CI") == "true" and os.geteuid() == 0:
            raise
        return test.skipTest(str(no_way))


class StoryTest(unittest.TestCase):
    def check_strike(self, strike):
        told = strike["data"]
        self.assertEqual((told["fate"], told["trouble"], told["struck_by"]), ("done", "", "strike1"))
        self.assertEqual(told["processed_by"], "sat1")
        for step in ("encode_ms", "fmv_way_ms", "fmv_run_ms", "strike_way_ms", "strike_run_ms"):
            self.assertGreater(told[step], 0, step)
        for step in ("fmv_queue_ms",):
            self.assertGreaterEqual(told[step], 0, step)
        self.assertAlmostEqual(sum(told[step] for step in STEPS), told["data_to_decision_ms"], 2)
        self.assertGreater(told["data_to_answer_ms"], told["data_to_decision_ms"])
        self.assertGreater(told["outcome"]["plots"], 10)  # its own sensor's
        return told

    def check_found(self, report):
        self.assertGreater(report["judged"], 0)
        if report["to_be_found"]:
            self.assertGreater(report["recall"], 0)
        frames = report["frames"]
        if (frames["skipped"] + frames["missing"]) * 5 > frames["captured"]:  # too many to follow a vehicle
            print(f"left out: {self.id()}: this machine is too busy to find targets")
            return
        if PATIENCE <= 30:  # a sanitizer leaves time for few frames, in which no vehicle may be in sight for long enough
            self.assertGreater(report["to_be_found"], 0)
        if report["to_be_found"]:
            self.assertGreaterEqual(report["recall"], 0.9)  # as in `jadc2.detection`
        # `jadc2.detection` requires 0.1 over many scenes. Here, one false track in few frames exceeds that.
        self.assertLessEqual(report["false_per_frame"], 0.5)

    def run_story(self, fleet):
        satellite, striker = fleet.satellite(), fleet.striker()
        # Frames must not fail on a busy machine. Under a sanitizer most would be skipped, and too few of them evaluated.
        recon = fleet.recon([satellite], "--fps", "30" if PATIENCE <= 30 else "6", "--deadline", "20000")
        mission = fleet.mission(recon, [striker], "--strikes", "3", "--duration", "60")
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        strikes = [self.check_strike(strike) for strike in mission.all("strike")]
        self.assertEqual(len(strikes), 3)
        self.assertEqual(len(mission.all("assessed")), 3)
        for one in mission.all("assessed"):
            self.assertEqual(one["data"]["hit"], one["data"]["missed_by"] <= 5, one)  # metres, which are ten pixels
        # One of 200 misses (`jadc2.engagement`): that two of three hit fails once in 10,000 runs.
        hits = [one for one in mission.all("assessed") if one["data"]["hit"] and one["data"]["is_target"]]
        self.assertGreaterEqual(len(hits), 2, mission.events)

        # The outcome of each job, at both of its ends.
        report = mission.all("report")[0]["data"]
        missed = sum(not one["data"]["hit"] for one in mission.all("assessed"))
        self.assertEqual(report, {"given": 3, "done": 3, "hit": 3 - missed, "missed": missed, "unseen": 0, "refused": 0,
                                  "failed": 0, "aborted": 0, "unknown": 0, "open": 0})
        for strike in strikes:  # hits are told when they happen
            seen = next(one for one in mission.all("assessed") if one["text"].startswith(f"order {strike['order']} "))
            self.assertGreater(seen["utc"], strike["outcome"]["impact_utc"] - 0.1)
        self.assertEqual(striker.pull("strike1:strike")["orders"], sorted(told["order"] for told in strikes))
        if PATIENCE <= 30:
            recon.wait_for("fusion")  # the satellite has a scan a second, and needs some of them
        recon.stop(signal.SIGINT)
        self.assertEqual(recon.end(), 0)
        report = recon.all("report")[0]["data"]
        frames = report["frames"]
        self.assertEqual(frames["captured"], frames["done"] + frames["missing"] + frames["skipped"])
        self.assertEqual(frames["nodes"], ["sat1"], frames)
        self.assertLessEqual(set(frames["failures"]), {"no_target"}, recon.events)  # before it was found
        processed = satellite.pull("sat1:FMV_Processing")
        self.assertEqual((processed["repeated"], processed["bad"]), (0, 0))
        self.assertGreaterEqual(processed["frames"], frames["done"])
        self.assertLessEqual(processed["frames"], frames["done"] + frames["missing"])
        self.check_found(report)
        if PATIENCE <= 30:
            self.assertGreater(report["corrected"], 0, recon.events)

        # No node knows others than those of its links.
        self.assertLessEqual(satellite.peers(), {"recon-camera"})
        self.assertEqual(striker.peers(), set())
        return satellite, recon, striker
