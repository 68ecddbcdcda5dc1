#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""All code of a platoon as processes, each part once and for as short as possible. The builds with sanitizers run this instead
of the other tests in Python of this folder, which assert more."""

import json
import os
import signal
import subprocess
import tempfile
import unittest

from processes import PATIENCE, PLATOON, DriveTest, children_of, ended, environment, free_group, run, start, wait_until
from secured_test import Listener
from two_hosts import Hosts


class Drives(DriveTest):
    def test_a_drive_in_which_everything_happens(self):
        """Secured, which runs all the code of a drive without security."""
        with tempfile.TemporaryDirectory() as folder:
            os.environ["TMPDIR"] = folder
            self.addCleanup(os.environ.pop, "TMPDIR", None)
            file = os.path.join(folder, "record.json")
            found = self.drive("--secured", "--vehicles", 5, "--hz", 10, "--seconds", 5, "--loss", 10, "--burst", 4, "--delay",
                               20, "--lags", 0.2, 0.5, "--brakes", 5.5, 8, "--merge", "0@0.1", "--join", "4@0.2", "--split",
                               "2@0.3", "--leave", "1@1", "--vanish", "3@2", "--record", file)
            with open(file, encoding="utf-8") as record:
                self.assertEqual(json.load(record), found)
            self.assertEqual(os.listdir(folder), ["record.json"])  # the keys are gone
        self.assertEqual(found["burst"], 4)
        self.assertGreater(found["lost"], 0)
        self.assertGreater(found["latency"]["count"], 5 * 10)
        merges = next(course for course in found["courses"] if course["vehicle"] == "v5")
        self.assertEqual(set(merges["place"]), {None})  # it is in the next lane
        self.assertIn("it splits off", [event["why"] for event in found["events"] if event["vehicle"] == "v2"])
        self.assertIn("left", self.modes(found, "v1"))
        self.assertIsNone(self.speed(found, "v1"))
        self.assertLessEqual({"killed", "gone"}, set(self.modes(found, "v3")))
        joined = next(course for course in found["courses"] if course["vehicle"] == "v4")
        self.assertIsNone(joined["speed"][0])
        self.assertIsNotNone(joined["speed"][-1])

    def test_a_drive_that_is_told_in_text(self):
        code, out, err = run("run", "--multicast", free_group(), "--vehicles", 2, "--hz", 10, "--seconds", 2, "--vanish",
                             "0@0.5", "--no-radar")
        self.assertEqual((code, err), (0, ""))
        self.assertRegex(out, r"(?m)^ +\d\.\d s  2 vehicles, 2\d\.\d\d to 2\d\.\d\d m/s, ")
        self.assertRegex(out, r"(?m)^ +\d\.\d s  v0  gone: its process was ended by signal 9 ")
        self.assertRegex(out, r"(?m)^gap +\d+\.\d{3} m at least\nradar     0 times .*\nfallback  1 times ")
        self.assertRegex(out, r"(?m)^latency   p50 \d")

    def test_a_drive_that_is_shown_and_cannot_be_recorded(self):
        code, out, err = run("run", "--multicast", free_group(), "--vehicles", 2, "--hz", 10, "--seconds", 1, "--view",
                             "--record", "/dev/full")
        self.assertEqual((code, err), (5, "cles-platoon: cannot write /dev/full: No space left on device\n"))
        self.assertRegex(out, r"\x1b\[H\x1b\[J +\d+\.\d s +m/s +m/s2  distance   error\nv0 +2\d\.\d\d .* lead")
        self.assertRegex(out, r"\nv1 +2\d\.\d\d .* 1\d\.\d\d .* follow")
        self.assertRegex(out, r"(?m)^spacing   \d")

    def test_a_drive_that_is_interrupted(self):
        watcher = start("run", "--multicast", free_group(), "--vehicles", 2, start_new_session=True)
        self.addCleanup(ended, watcher)
        wait_until(lambda: children_of(watcher.pid), "it starts vehicles")
        os.killpg(watcher.pid, signal.SIGINT)
        out, err = watcher.communicate(timeout=PATIENCE)
        self.assertEqual((watcher.returncode, err), (4, ""))
        self.assertRegex(out, r"(?m)^gap +(unknown: the drive ended before all vehicles had started|\d+\.\d{3} m at least)$")

    def test_a_drive_on_a_network(self):
        hosts = Hosts()
        self.addCleanup(hosts.close)
        for more in (["--insecure"], []):
            done = subprocess.run([*hosts.inside(hosts.near), PLATOON, "run", "--multicast", "v0", "--vehicles", "3", "--hz",
                                   "10", "--seconds", "3", "--leave", "1@0.6", "--join", "2@0.1", *more],
                                  stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE, check=False,
                                  env=environment())
            if more:
                self.assertEqual((done.returncode, done.stderr), (0, ""))
                self.assertRegex(done.stdout, r"(?m)^ +\d\.\d s  v1  left: ended normally$")
            else:
                self.assertEqual((done.returncode, done.stdout), (5, ""))
                self.assertRegex(done.stderr, r"^cles-platoon: .*\(--insecure\)\n$")


class Alone(unittest.TestCase):
    def test_without_others(self):
        code, out, err = run("vehicle", "--name", "v9", "--multicast", free_group())
        self.assertEqual((code, out), (3, ""))
        self.assertIn("there is no platoon", err)

    def test_another_platoon(self):
        group = free_group()
        other = start("vehicle", "--name", "v0", "--lead", "--multicast", group)
        self.addCleanup(ended, other)
        listener = Listener(group)
        self.addCleanup(listener.close)
        wait_until(lambda: listener.heard, "it sends")
        self.assertEqual(run("run", "--multicast", group),
                         (6, "", "cles-platoon: another platoon uses this group (received v0): choose another port with "
                                 "--multicast\n"))

    def test_virtual_time(self):
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "record.json")
            code, out, err = run("simulate", "--vehicles", 4, "--seconds", 20, "--brake-at", 100, "--seeds", 2, "--merge", "1@0.1",
                                 "--split", "3@0.3", "--leave", "2@17", "--mute", "0@18+1", "--vanish", "1@12", "--record", file)
            self.assertEqual((code, err), (0, ""))
            with open(file, encoding="utf-8") as record:
                found = json.load(record)
        self.assertEqual(len(found["courses"]), 5)
        told = [event["why"] for event in found["events"]]
        self.assertIn("it changes into the lane behind v1", told, found["events"])
        self.assertIn("it splits off", told)
        self.assertRegex(out, r"^seed 1 .*\nseed 2 .*\nall ")
        code, out, err = run("simulate", "--vehicles", 3, "--hz", 10, "--sine", 1)
        self.assertEqual((code, err), (0, ""))
        self.assertRegex(out, r"(?m)^sine +.*accelerations \d\.\d{4} times those of the one ahead, at most$")
        code, out, err = run("simulate", "--vehicles", 2, "--seconds", 1, "--seeds", 2)
        self.assertEqual((code, err), (4, ""))
        self.assertRegex(out, r"(?m)^ended     no: ")
        code, out, err = run("tune", "--vehicles", 2, "--hz", 10, "--brake-at", 0.5, "--seconds", 2.5)
        self.assertEqual((code, err), (0, ""))
        costs = [float(line.rpartition(" ")[2]) for line in out.splitlines()]
        self.assertRegex(out, r"^start +q1 1\.\d+, .*\n(better +q1 .*\n)*best +q1 .*\n$")
        self.assertEqual(costs, sorted(costs, reverse=True))

    def test_wrong_usage(self):
        with tempfile.TemporaryDirectory() as folder:
            for code, said, arguments in (
                    (2, "which vehicle is it? Give --name", ["vehicle"]),
                    (2, "'x': write the number of a vehicle and a time", ["run", "--vanish", "x"]),
                    (2, "'99@1': the vehicles are 0 to 9", ["run", "--vanish", "99@1"]),
                    (2, "vehicle 0 leads", ["run", "--join", "0@1"]),
                    (2, "--split: ", ["simulate", "--no-radar", "--split", "1@2"]),
                    (2, "--burst: ", ["simulate", "--loss", "60", "--burst", "1.2"]),
                    (2, "--lags and --brakes: ", ["simulate", "--lags", "0.5", "0.2"]),
                    (2, "--hz", ["run", "--hz", "5"]),
                    (3, "by multicast, which is off", ["run", "--multicast", "off"]),
                    (5, "cannot write /nowhere/record", ["simulate", "--vehicles", "2", "--seconds", "1", "--record", "/nowhere/record"]),
                    (5, "cannot write /nowhere/record", ["run", "--vehicles", "2", "--record", "/nowhere/record"]),
                    (5, "cannot open the folder /nowhere", ["vehicle", "--keys", "/nowhere"]),
                    (5, f"{folder} has no keys of operator,v0,v1: ",
                     ["run", "--multicast", free_group(), "--vehicles", "2", "--keys", folder])):
                ended_with, out, err = run(*arguments)
                self.assertEqual((ended_with, out), (code, ""), arguments)
                self.assertIn(said, err)


if __name__ == "__main__":
    unittest.main()
