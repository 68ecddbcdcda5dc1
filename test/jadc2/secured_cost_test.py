#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the measurement of what security costs the case studies in its quick form, and checks its output.

    secured_cost_test.py FOLDER PROGRAMS

FOLDER holds the measurement, PROGRAMS the programs.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest

FOLDER, PROGRAMS = sys.argv[1], sys.argv[2]


class Cost(unittest.TestCase):
    def test_each_is_measured(self):
        with tempfile.TemporaryDirectory() as files:
            done = subprocess.run([sys.executable, "-B", f"{FOLDER}/secured_cases.py", "--quick", "--programs", PROGRAMS],
                                  capture_output=True, text=True, check=False, env={**os.environ, "TMPDIR": files})
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(os.listdir(files), [])
        result = json.loads(done.stdout)
        figures = {each["name"]: each for each in result["figures"]}
        self.assertTrue(all(each["value"] > 0 and each["runs"] == 1 for each in figures.values()), figures)
        for what, kinds in (("update", ("plain", "secured")), ("strike", ("plain", "sealed", "signed"))):
            for kind in kinds:
                self.assertLessEqual(figures[f"{what}_{kind}_p50"]["value"], figures[f"{what}_{kind}_p99"]["value"])
        for drives in result["drives"].values():
            self.assertEqual([drive["collision"] for drive in drives], [False])
        for drills in result["drills"].values():
            self.assertEqual([drill["count"] for drill in drills], [50])
        self.assertTrue({"title", "command", "machine", "date", "quick"} <= result.keys())

    def test_told_to_end_it_leaves_nothing(self):
        with tempfile.TemporaryDirectory() as files, \
                subprocess.Popen([sys.executable, "-B", f"{FOLDER}/secured_cases.py", "--programs", PROGRAMS],
                                 stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                 env={**os.environ, "TMPDIR": files}) as script:
            until = time.monotonic() + 60
            while not any(name.startswith("cles-platoon-") for name in os.listdir(files)):
                self.assertLess(time.monotonic(), until, "no platoon was started")
                time.sleep(0.05)
            script.send_signal(signal.SIGTERM)
            self.assertEqual(script.wait(60), 143)
            self.assertEqual(os.listdir(files), [])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
