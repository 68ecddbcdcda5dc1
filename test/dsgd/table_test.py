#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the measurement of the paper's Table 2 in its quick form, and checks its output.

    table_test.py FOLDER PROGRAMS

FOLDER holds the measurement, PROGRAMS `clesd` and `cles-dsgd`.
"""

import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

FOLDER, PROGRAMS = sys.argv[1], sys.argv[2]
sys.path.insert(0, FOLDER)
import dsgd_points  # noqa: E402
import interval  # noqa: E402

ROWS = ["local_one_near", "local_one_far", "local_all_near", "local_all_far", "near_asked_by_near", "near_asked_by_far",
        "both_asked_by_far", "both_weighted"]


class Table(unittest.TestCase):
    def test_every_row_is_measured(self):
        with tempfile.TemporaryDirectory() as folder:
            output = Path(folder) / "dsgd.json"
            done = subprocess.run([sys.executable, "-B", f"{FOLDER}/dsgd.py", "--quick", "--programs", PROGRAMS,
                                   "-o", str(output)], capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            result = json.loads(output.read_text(encoding="utf-8"))
        self.assertEqual([row["name"] for row in result["rows"]], ROWS)
        self.assertTrue(result["checks"]["same_mse_to_6_digits"])
        self.assertTrue(result["checks"]["mse_found_again"])
        self.assertTrue(all(abs(x) < 1 and abs(y) < 1 for x, y, _ in result["pictured"]["near"]))
        self.assertEqual({of_class for _, _, of_class in result["pictured"]["some"]}, {0, 1})
        for row in result["rows"]:
            self.assertEqual(row["elapsed_ms"]["runs"], 3)
            self.assertGreater(row["elapsed_ms"]["low"], 0)
            if not row["name"].startswith("local"):
                self.assertGreater(row["overhead_ms"]["median"], 0)
        weighted = result["rows"][-1]
        for points in weighted["points"]:
            self.assertEqual(sum(points), 200_000)
        if result["hosts"]["far_quota"] is None:
            self.assertTrue(any("quota" in text for text in result["hosts"]["not_allowed"]))

    def test_a_classifiers_error_is_found_again(self):
        points = dsgd_points.made()
        self.assertEqual(len(points), 200_000)
        nothing = {"weights": [0.0, 0.0], "bias": 0.0}
        self.assertAlmostEqual(dsgd_points.mean_squared_error(points, nothing), 0.5, 12)
        along = {"weights": [1.0, 0.0], "bias": 0.0}
        self.assertNotAlmostEqual(dsgd_points.mean_squared_error(points, along), 0.5, 2)
        done = subprocess.run([f"{PROGRAMS}/cles-dsgd", "--local", "1", "--epochs", "1", "--json"], capture_output=True,
                              text=True, check=True)
        report = json.loads(done.stdout)
        self.assertAlmostEqual(dsgd_points.mean_squared_error(points, report["result"]), report["quality"]["mse"], 9)

    def test_an_interval_holds_the_median_and_narrows(self):
        few = interval.summary([1.0, 2.0, 3.0, 4.0, 100.0])
        self.assertEqual(few["median"], 3.0)
        self.assertLessEqual(few["low"], 3.0)
        self.assertGreaterEqual(few["high"], 3.0)
        many = interval.summary([1.0, 2.0, 3.0, 4.0, 5.0] * 40)
        self.assertLess(many["high"] - many["low"], few["high"] - few["low"])
        self.assertEqual(interval.summary([2.0] * 9)["low"], 2.0)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
