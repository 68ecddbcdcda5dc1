#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the measurement from data to decision in its quick form, as `scripts/evaluate` does, and checks what it writes to the
page.

    decision_test.py FOLDER BUILD

FOLDER holds the measurement, BUILD the programs.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

FOLDER, BUILD = sys.argv[1], sys.argv[2]
sys.path[:0] = [str(Path(__file__).parents[1] / "perf"), FOLDER]
import decision_latency  # noqa: E402
import evaluated  # noqa: E402
import reported  # noqa: E402
from story import namespaces  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 200  # less than the test may take, so that what was started is ended


def result(scale=1.0):
    """As the measurement writes it."""
    def run(i):
        return {"seed": i, **{step: scale * (n + i / 10) for n, step in enumerate(decision_latency.STEPS)}}

    runs = {link: [run(i) for i in range(5)] for link in (decision_latency.CABLE, decision_latency.SLOW)}
    texts = decision_latency.links(64)
    return {"title": "t", "command": "c", "machine": "a machine", "date": "2026-01-02", "quick": False, "kbit": 64,
            "links": texts, "steps": decision_latency.STEPS, "figures": list(decision_latency.figures(runs, texts)), "runs": runs}


class Measured(unittest.TestCase):
    def test_each_step_is_measured(self):
        namespaces(self).close()  # or it is skipped
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as files:
            raw, _ = evaluated.evaluated(self, "decision_latency", BUILD, folder, LIMIT_S, env={**os.environ, "TMPDIR": files})
            self.assertEqual(os.listdir(files), [])
        reported.check(self, "decision_latency", raw)
        figures = {each["name"]: each for each in raw["figures"]}
        for link in (decision_latency.CABLE, decision_latency.SLOW):
            self.assertEqual(len(raw["runs"][link]), 2)
            for run in raw["runs"][link]:
                parts = [run[step] for step in list(decision_latency.STEPS)[:7]]
                self.assertAlmostEqual(sum(parts), run["data_to_decision_ms"], 2)
                self.assertGreater(run["data_to_answer_ms"], run["data_to_decision_ms"])
            for step in decision_latency.SUMS:
                self.assertGreater(figures[f"{link}_{step}"]["value"], 0)
                self.assertLessEqual(figures[f"{link}_{step}"]["value"], figures[f"{link}_{step}_late"]["value"])
        self.assertTrue({"title", "command", "machine", "date", "quick", "without_strike"} <= raw.keys())


class Page(unittest.TestCase):
    def test_the_page_has_a_place_and_keeps_the_rest(self):
        page = (ROOT / "docs" / decision_latency.PAGE).read_text(encoding="utf-8")
        once = decision_latency.page_with(page, result())
        before, after = page.split(decision_latency.BEGIN)[0], page.split(decision_latency.END)[1]
        self.assertTrue(once.startswith(before + decision_latency.BEGIN))
        self.assertTrue(once.endswith(decision_latency.END + after))
        self.assertEqual(decision_latency.page_with(once, result()), once)
        self.assertNotEqual(decision_latency.page_with(once, result(2)), once)

    def test_each_step_and_each_sum_has_a_row(self):
        said = decision_latency.words(result())
        self.assertIn("5 runs of each", said)
        self.assertIn("| | by cable | with 64 kbit/s at the mission centre |", said)
        rows = [line for line in said.splitlines() if line.startswith("| ")]
        self.assertEqual(len(rows), 2 + len(decision_latency.STEPS) + 2)
        # The steps are numbered from 0, and the five runs are 0.1 apart.
        self.assertIn("| data to decision, median | 7.2 ms (7 to 7.4) | 7.2 ms (7 to 7.4) |", rows)
        self.assertTrue([row for row in rows if row.startswith("| data to answer, 99 % of the runs within | 10.4 ms (")], rows)
        self.assertIn("(jadc2_decision.svg)", said)

    def test_a_page_without_a_place_is_refused(self):
        for text in ("", decision_latency.BEGIN, decision_latency.END + decision_latency.BEGIN):
            with self.assertRaisesRegex(SystemExit, "no place for the figures"):
                decision_latency.page_with(text, result())

    def test_what_was_measured_earlier_is_published(self):
        with tempfile.TemporaryDirectory() as folder:
            page, raw = Path(folder, decision_latency.PAGE), Path(folder, "raw.json")
            page.write_text(f"a\n{decision_latency.BEGIN}\nb\n{decision_latency.END}\nc\n", encoding="utf-8")
            for quick in (True, False):
                raw.write_text(json.dumps({**result(), "quick": quick}), encoding="utf-8")
                done = subprocess.run([sys.executable, "-B", f"{FOLDER}/decision_latency.py", "--from", str(raw), "--docs", folder],
                                      capture_output=True, text=True, timeout=60, check=False)
                drawn = Path(folder, "jadc2_decision.svg").exists()
                if quick:
                    self.assertEqual((done.returncode, drawn), (2, False), done.stderr)
                elif shutil.which("gnuplot"):
                    self.assertEqual((done.returncode, drawn), (0, True), done.stderr)
                    self.assertIn("data to answer, median", page.read_text(encoding="utf-8"))
                else:
                    self.assertIn("there is no gnuplot", done.stderr)
                    self.assertEqual(page.read_text(encoding="utf-8").split("\n")[2], "b")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
