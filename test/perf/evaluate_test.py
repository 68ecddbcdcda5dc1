#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs `scripts/evaluate --quick`: checks that it works, not the figures. Sections whose scripts have a test of
their own, which runs them with the same options, are left to it.

    evaluate_test.py ROOT BUILD
"""

import json
import sys
import tempfile
import unittest
from pathlib import Path
from xml.etree import ElementTree

import reported
from run_within import run_within

ROOT, BUILD = Path(sys.argv[1]), Path(sys.argv[2])
sys.path[:0] = [str(ROOT / "perf")]
from report import figures, sections  # noqa: E402

# Section: its test.
TESTED_ELSEWHERE = {"decision_latency": "jadc2/decision_test.py", "digits_speed": "dsgd/digits_speed_test.py",
                    "dsgd": "dsgd/table_test.py",
                    "latency": "effort/latency_test.py", "platoon": "platoon/evaluation_test.py",
                    "secured_cases": "jadc2/secured_cost_test.py", "strike_latency": "jadc2/latency_test.py"}
LIMIT_S = 1680  # less than the timeout of this test, so that what it started is ended


class Quick(unittest.TestCase):
    def test_every_section_that_there_is_runs(self):
        with tempfile.TemporaryDirectory(prefix="cles-evaluate-") as folder:
            names = [each.name for each in sections.known(ROOT / "perf" / "evaluation") if each.name not in TESTED_ELSEWHERE]
            done = run_within(LIMIT_S, [sys.executable, "-B", str(ROOT / "scripts" / "evaluate"), "--quick", "--build",
                                        str(BUILD), "-o", folder, *(f"--only={name}" for name in names)])
            print(done.stderr)
            self.assertEqual(done.returncode, 0, done.stderr)
            run = json.loads((Path(folder) / "raw" / "run.json").read_text(encoding="utf-8"))
            page = ElementTree.parse(Path(folder) / "index.html").getroot()
            raws = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in (Path(folder) / "raw").glob("*.json")}
        for name, told in run["sections"].items():
            there = (ROOT / "perf" / "evaluation" / f"{name}.py").exists()
            if name in TESTED_ELSEWHERE:
                self.assertTrue((ROOT / "test" / TESTED_ELSEWHERE[name]).exists(), name)
            elif name != "peers":  # whose programs are only in some builds
                self.assertEqual(told["state"], "ran" if there else "skipped", (name, told))
            if told["state"] == "ran":
                with self.subTest(section=name):
                    self.assertTrue(figures.figures_of(raws[name]) or raws[name].get("rows"), "neither a figure nor a row")
                    reported.check_ratios(self, figures.figures_of(raws[name]))
        self.assertEqual(run["sections"]["bench"]["state"], "ran")
        for key in ("command", "date", "compiler", "machine"):
            self.assertTrue(run[key], key)
        names = {figure["name"] for figure in raws["bench"]["figures"]}
        for name in ("pull_tcp_ratio", "pull_overhead", "pull_reply_bytes", "parse_typed_growth", "update_tcp_64_p50"):
            self.assertIn(name, names)
        text = " ".join("".join(page.itertext()).split())
        self.assertIn("PULL over a Unix socket, p99", text)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
