#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the measurement of what security costs the case studies in its quick form, as `scripts/evaluate` does, and checks its
output.

    secured_cost_test.py FOLDER BUILD

FOLDER holds the measurement, BUILD the programs.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

FOLDER, BUILD = sys.argv[1], sys.argv[2]
sys.path[:0] = [str(Path(__file__).parents[1] / "perf")]
import evaluated  # noqa: E402
import reported  # noqa: E402

LIMIT_S = 200  # less than the test may take, so that what was started is ended


class Cost(unittest.TestCase):
    def test_each_is_measured(self):
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as files:
            result, _ = evaluated.evaluated(self, "secured_cases", BUILD, folder, LIMIT_S, env={**os.environ, "TMPDIR": files})
            self.assertEqual(os.listdir(files), [])
        reported.check(self, "secured_cases", result)
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
                subprocess.Popen([sys.executable, "-B", f"{FOLDER}/secured_cases.py", "--programs", f"{BUILD}/apps",
                                  "--orders", "50", "--seconds", "4"],  # of the drive before the one that it waits for
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
