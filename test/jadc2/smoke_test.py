#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""All code of joint command as processes, each part once and for as short as possible. The builds with sanitizers run this
instead of the other tests in Python of this folder, which assert more.

    smoke_test.py PROGRAMS [CASE...]
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
import unittest

import secured_test
from jadc2_fleet import OLDEST_S, PATIENCE, RIGHTS, Fleet, Process, clean_environment, free_port
from story import StoryTest

PROGRAMS = sys.argv[1]
MEMBERS = ("sat1", "strike1", "recon", "recon-camera", "mission", "operator", "loader")


def run(*arguments, program="cles-jadc2", typed=""):
    """Exit code, stdout, stderr."""
    done = subprocess.run([os.path.join(PROGRAMS, program), *arguments], input=typed, capture_output=True,
                          text=True, timeout=PATIENCE, check=False, env={**clean_environment(), "CLES_MULTICAST": "off"})
    return done.returncode, done.stdout, done.stderr


class Story(StoryTest):
    """Secured, which runs all the code of a story without security."""

    def setUp(self):
        self.fleet = Fleet(PROGRAMS, rights={name: RIGHTS[name] for name in MEMBERS})
        self.addCleanup(self.fleet.close)
        self.addresses = {role: f"tls://127.0.0.1:{free_port()}" for role in ("satellite", "recon")}

    def satellite(self):
        return self.fleet.satellite(plugins=[f"{{path: {self.fleet.plugin('fmv')}, config: {{streams: 2, idle_s: 600, plots: true}}}}"],
                                    port=int(self.addresses["satellite"].rpartition(":")[2]))

    def test_from_the_first_frame_to_the_last_weapon(self):
        fleet, at = self.fleet, self.addresses
        plugin = f"{{path: {fleet.plugin('strike')}, config: {{oldest_s: {OLDEST_S}, weapons: 1, must_be_signed: true}}}}"
        striker = fleet.striker(plugins=[plugin])
        code, out, err = run("drill", "--at", striker.url, "-n", "1", "--keys", fleet.keys("mission"))
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(json.loads(out)["count"], 1)
        self.assertEqual(striker.pull("strike1:strike"), {"left": 1, "orders": []})

        # Each waits for the one that starts after it.
        mission = fleet.mission(at["recon"], [striker], "--age", "0", "--deadline", "20000")
        mission.wait_for("trouble", f"is cles-jadc2 recon running at {at['recon']} (--recon)?")
        recon = fleet.recon([at["satellite"]], "--fps", "10", "--deadline", "20000", listen=at["recon"])
        recon.wait_for("trouble", "no processing: no node answers at the given address (--satellite)")
        mission.wait_for("trouble", "no node processes the video of recon: ")
        satellite = self.satellite()
        recon.wait_for("processing", "sat1 processes the video")
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        mission.wait_for("processing", "sat1 processes the video")
        self.check_order(mission, striker)
        mission = self.check_operator(recon, striker)
        self.check_losses(mission, recon, satellite)

    def check_order(self, mission, striker):
        (strike,) = mission.all("strike")
        told = self.check_strike(strike)
        (seen,) = mission.all("assessed")
        self.assertEqual(seen["data"]["hit"], seen["data"]["missed_by"] <= 5, seen)
        told_in_the_end = mission.all("report")[0]["data"]
        self.assertEqual(told_in_the_end, {**told_in_the_end, "given": 1, "done": 1, "unseen": 0, "refused": 0, "failed": 0,
                                           "unknown": 0, "open": 0})
        self.assertEqual(striker.pull("strike1:strike"), {"left": 0, "orders": [told["order"]]})

    def check_operator(self, recon, striker):
        """The operator's orders, none of which is carried out."""
        mission = self.fleet.mission(recon, [striker], "--operator", "--strikes", "100", stdin=subprocess.PIPE)
        mission.wait_for("picture")
        for words, said in (("strike", "'strike' is not an order"), ("strike 999999", "there is no target 999999 now")):
            mission.process.stdin.write(words + "\n")
            mission.process.stdin.flush()
            mission.wait_for("operator", said)
        mission.order_by_hand()
        mission.wait_for("strike", "no weapon is left")
        self.assertEqual(striker.stop(), 0)
        fate = ""
        while fate != "refused":  # until it is known that the aircraft is gone, the fate of an order is not
            after = mission.told()
            mission.order_by_hand()
            fate = (strike := mission.wait_for("strike", after=after)["data"])["fate"]
            self.assertIn(fate, ("refused", "unknown"), strike)
        # Either it could not be reached, or it has been forgotten by then.
        self.assertRegex(strike["trouble"], r"refused|is clesd running there\?$|and may mission request it\?$")
        code, out, err = run("push", "recon:impact", "-d", '{"by":"","target":0,"lat":null,"lon":0,"utc":0}', "--at",
                             recon.url, "--keys", self.fleet.keys("mission"), program="cles")
        self.assertEqual((code, out), (5, ""))
        self.assertIn("bad_request: recon: lat, lon and utc: degrees", err)
        return mission

    def check_losses(self, mission, recon, satellite):
        """The satellite is lost, then recon; both come back."""
        satellite.kill()
        mission.wait_for("trouble", "is libcles-fmv.so among the plugins of a node, and may recon-camera request it?")
        recon.stop(signal.SIGINT)
        self.assertEqual(recon.end(), 0)
        report = recon.all("report")[0]["data"]
        frames = report["frames"]
        self.assertEqual(frames["captured"], frames["done"] + frames["missing"] + frames["skipped"])
        self.assertEqual(frames["nodes"], ["sat1"], frames)
        self.assertGreater(report["judged"], 0)
        mission.wait_for("trouble", "recon is lost: ")

        satellite = self.satellite()
        recon = Process(self.fleet, "recon", [
            self.fleet.program("cles-jadc2"), "recon", "--fps", "10", "--deadline", "20000", "--listen", self.addresses["recon"],
            "--camera-listen", "tls://127.0.0.1:0", "--satellite", satellite.url, *self.fleet.keys_option("recon")])
        mission.wait_for("rebound", "recon is back")
        text = ""
        while "sat1 processes the video, from frame " not in text:
            text += recon.process.stdout.readline() or self.fail(recon.said_wrong())
        mission.process.stdin.close()
        mission.wait_for("operator", "the operator has left: ")
        code, told = mission.end(), mission.all("report")[0]["data"]
        self.assertEqual(told, {**told, "done": 0, "refused": 2, "failed": 0, "unknown": told["given"] - 2, "open": 0})
        self.assertEqual(code, 4 if told["unknown"] else 3)
        self.assertEqual(recon.stop(), 0, recon.said_wrong())
        text += recon.process.stdout.read()
        self.assertRegex(text, r"(?m)^\d\d:\d\d:\d\d\.\d{3} recon: sat1 processes the video, from frame \d+ on(; \d+ before it are missing)?$")
        done = re.search(r"(?m) recon: \d+ frames: (\d+) done, ", text)
        self.assertTrue(done, text)
        self.check_load(satellite, int(done[1]))
        self.assertEqual(satellite.stop(), 0)

    def check_load(self, satellite, done):
        """The stream of recon has ended with it, and there is place for two: they are processed in parallel."""
        until = time.monotonic() + PATIENCE
        while (told := satellite.pull("sat1:FMV_Processing"))["streams"]:
            self.assertLess(time.monotonic(), until, told)
        frames = told["frames"]
        self.assertGreaterEqual(frames, done)
        load = ("load", "--streams", "2", "--duration", "0.3", "--at", satellite.url, "--keys", self.fleet.keys("loader"))
        code, out, err = run(*load)
        self.assertEqual((code, err), (0, ""))
        began, told = out.splitlines()
        self.assertEqual(began, "loading")
        self.assertEqual(satellite.pull("sat1:FMV_Processing"),
                         {"streams": 2, "frames": frames + json.loads(told)["frames"], "repeated": 0, "refused": 0, "bad": 0})
        code, out, err = run(*load)
        self.assertEqual((code, out), (6, ""))
        self.assertIn("the limit of streams is reached", err)


class Usage(secured_test.Usage):
    """What goes wrong before anything begins; and the rehearsal."""

    def test_rehearsing_nothing(self):
        code, out, err = run("rehearse", "--strikes", "0")
        self.assertEqual((code, out), (2, ""))
        self.assertNotEqual(err, "")

    def test_comparing(self):
        code, out, err = run("compare", "--scenes", "1", "--seconds", "3")
        self.assertEqual((code, err), (0, ""))
        self.assertLessEqual(json.loads(out)["fused"], json.loads(out)["scenes"])

    def test_rehearsing(self):
        code, out, err = run("rehearse", "--strikes", "1")
        self.assertEqual((code, err), (0, ""))
        for record in json.loads(out).values():
            self.assertEqual((record["strikes"], record["not_aimed"]), (1, 0))
            self.assertLess(record["median_missed_by"], 20)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[2:])
