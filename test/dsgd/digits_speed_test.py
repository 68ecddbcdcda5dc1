#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the measurement of distributed descent on digits in its quick form, with drawn digits, and checks its output and its
decisions, not how fast it is.

    digits_speed_test.py FOLDER BUILD

FOLDER holds the measurement, BUILD the programs.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from xml.etree import ElementTree

FOLDER, BUILD = sys.argv[1], sys.argv[2]
sys.path[:0] = [FOLDER, str(Path(__file__).parents[1] / "perf")]
import digits_speed  # noqa: E402
import reported  # noqa: E402


class Speed(unittest.TestCase):
    def test_each_side_is_measured(self):
        with tempfile.TemporaryDirectory() as folder:
            words = [sys.executable, "-B", f"{FOLDER}/digits_speed.py", "--quick", "--drawn", "--programs", f"{BUILD}/apps", "-o",
                     f"{folder}/result.json"]  # as `scripts/evaluate --quick` calls it, where there are no other digits
            if shutil.which("gnuplot"):
                words += ["--picture", f"{folder}/picture.svg"]
            done = subprocess.run(words, capture_output=True, text=True, timeout=270, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            result = json.loads(Path(folder, "result.json").read_text(encoding="utf-8"))
            if shutil.which("gnuplot"):
                self.assertTrue(ElementTree.parse(f"{folder}/picture.svg").getroot().tag.endswith("svg"))
        figures = {each["name"]: each for each in result["figures"]}
        reported.check(self, "digits_speed", result)
        self.assertEqual(figures["speed_up_nodes"]["runs"], 2)
        self.assertIn(figures["speed_up_nodes"]["reached"], (True, False))
        # One node computes what one thread does.
        self.assertEqual(figures["accuracy_one"]["value"], figures["accuracy_thread"]["value"])
        self.assertEqual(result["rates"]["one"], result["rates"]["thread"])
        self.assertGreater(figures["bytes_two"]["value"], 1.9 * figures["bytes_one"]["value"])
        for side in digits_speed.SIDES:
            self.assertGreater(figures[f"images_per_s_{side}"]["value"], 0)
            self.assertEqual(len(result["curves"][side]), result["rounds"])
            self.assertIn(result["rates"][side], digits_speed.RATES)

    def test_the_first_round_that_reaches_it_counts(self):
        def report(*accuracies):
            return {"accuracies": [{"round": k, "accuracy": each, "after_ms": 10.0 * k} for k, each in enumerate(accuracies, 1)]}

        self.assertEqual(digits_speed.reached(report(0.5, 0.97, 0.9)), (2, 20.0))
        self.assertIsNone(digits_speed.reached(report(0.5, 0.969)))

    def test_the_size_of_a_step_that_needs_the_fewest_rounds_is_taken(self):
        needed = dict(zip(digits_speed.RATES, (5, 3, 2, 2, 9)))
        ends = dict(zip(digits_speed.RATES, (0.99, 0.99, 0.97, 0.98, 0.99)))

        class Scripted:
            @staticmethod
            def run(side, rate, seed, rounds, evaluate):
                accuracies = [0.5] * (needed[rate] - 1) + [0.97] * (rounds + 1 - needed[rate])
                return {"accuracy": ends[rate], "accuracies": [{"round": k, "accuracy": each, "after_ms": 1.0}
                                                               for k, each in enumerate(accuracies[:rounds], 1)]}

        self.assertEqual(digits_speed.searched_rate(Scripted, "two", 8, (1, 2, 3)), digits_speed.RATES[3])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
