#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The page of the paper's evaluation (docs/evaluation.md): that it shows what was measured and nothing else, that it is not
made from what does not show how fast anything is, and that the one in the project is that of its record.

    evaluation_page_test.py ROOT
"""

import copy
import json
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(sys.argv[1])
sys.path[:0] = [str(ROOT / "perf"), str(ROOT / "perf" / "evaluation")]
import decision_latency  # noqa: E402
import digits_speed  # noqa: E402
import dsgd_figures  # noqa: E402
import latency  # noqa: E402
from report import evaluation  # noqa: E402

SAMPLES = Path(__file__).parent / "samples"
MACHINE = {"system": "Linux-6.18", "processor": "a processor", "cores": 2, "busy_cores": 0.01}
RUN = {"date": "2026-01-02T03:04:05+00:00", "commit": "abc1234", "compiler": "g++ 12.2", "machine": MACHINE,
       "sections": {name: {"state": "ran", "seconds": 600.0} for name in evaluation.SECTIONS}}


def sample(name):
    return json.loads((SAMPLES / f"{name}.json").read_text(encoding="utf-8"))


def measured_latency():
    figures = latency.Figures()
    of = {"p50": lambda kind: lambda some: some[0][kind], "p99": lambda kind: lambda some: 3 * some[0][kind]}
    for place, (link, meaning) in enumerate(evaluation.LINKS.items(), 1):
        rounds = [{kind: 10.0 * place + 3 * i for i, kind in enumerate(latency.KINDS)}]
        latency.add_latencies(figures, rounds, link, meaning, of, {"pull": "both", "update": "both"})
        if link != "loopback":
            latency.add_one_way(figures, rounds, link, meaning, of, "both")
    sizes = {part: {"icd_tcp": {"bytes": by_hand}, "tcp": {"bytes": ours}, "unrounded_tcp": {"bytes": ours + 48}}
             for part, by_hand, ours in (("PULL request", 4, 30.4), ("PULL reply", 44, 100.2))}
    latency.add_bytes(figures, sizes)
    latency.add_lines(figures)
    series = {link: {kind: [[10.0, 11.0]] for kind in latency.KINDS} for link in evaluation.LINKS if link != "loopback"}
    return {"title": "Latency", "command": "c", "machine": MACHINE, "date": "2026-01-02", "quick": False, "skipped": [],
            "links": {link: meaning for link, meaning in evaluation.LINKS.items() if link != "loopback"},
            "figures": figures.found, "series": series}


def measured_decision():
    texts = decision_latency.links(64)
    runs = {link: [{"seed": i, **{step: 1.0 + i + n for n, step in enumerate(decision_latency.STEPS)}} for i in range(5)]
            for link in texts}
    return {"title": "Decision", "command": "c", "machine": MACHINE, "date": "2026-01-02", "quick": False, "kbit": 64,
            "links": texts, "steps": decision_latency.STEPS, "figures": list(decision_latency.figures(runs, texts)), "runs": runs}


def measured_descent():
    found = {**sample("dsgd"), "quick": False, "threads": 4, "machine": MACHINE}
    others = [each for each in found["figures"] if not each["name"].startswith("lines")]
    pictured = {"of": 4, "box": 1, "classifier": {"weights": [0.1, 0.1], "bias": 0.5},
                "some": [[-2, -2, 0], [2, 2, 1], [-1, -3, 1]], "near": [[-0.5, -0.5, 0], [0.5, 0.5, 1]]}
    return {**found, "figures": [*others, *dsgd_figures.lines()], "pictured": pictured,
            "hosts": {**found["hosts"], "not_allowed": ["a quota"]}}


def measured_digits():
    courses = {side: [{"accuracies": [{"round": k, "accuracy": 0.5 + 0.1 * k, "after_ms": 10.0 * k} for k in range(1, 6)],
                       "accuracy": 1.0, "bytes_per_round": 51_953} for _ in range(4)] for side in digits_speed.SIDES}
    courses["non_iid"] = [{**each, "accuracies": each["accuracies"][:2]} for each in courses["non_iid"]]
    speeds = {side: [1000.0 * place] * 4 for place, side in enumerate(digits_speed.SIDES, 1)}
    curves = digits_speed.curves_of(courses)
    return {"title": "Digits", "command": "c", "machine": MACHINE, "date": "2026-01-02", "quick": False, "drawn": False, "seeds": 4,
            "rounds": 60, "hidden": 64, "rates": dict.fromkeys(digits_speed.SIDES, 0.05), "curves": curves,
            "figures": list(digits_speed.figures_of(speeds, courses, 60)),
            "series": {"accuracy": {"lines": digits_speed.lines_of(curves)}}}


RAWS = {"latency": measured_latency(), "bench": {**sample("bench"), "quick": False, "machine": MACHINE},
        "dsgd": measured_descent(), "decision_latency": measured_decision()}


class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.record = evaluation.record_of(RAWS, RUN)
        cls.page = evaluation.page_of(cls.record)

    def refusal(self, **changed):
        raws = copy.deepcopy(RAWS)
        for section, changes in changed.items():
            raws[section].update(changes)
        with self.assertRaises(evaluation.Unfit) as refused:
            evaluation.record_of(raws, RUN)
        return str(refused.exception)

    def test_a_record_that_was_read_again_gives_the_same_page(self):
        again = json.loads(evaluation.files_of(self.record)[evaluation.RECORD])
        self.assertEqual(evaluation.files_of(again), evaluation.files_of(self.record))

    def test_figures_stand_there_as_they_were_measured(self):
        self.assertIn("| two hosts, a virtual cable | 40 | 43 | 3 | 1.07 | 120 → 129 | 49 | 1.14 | 52 |", self.page)
        self.assertIn("| the reply, values rounded as a user would | 44 | 100.2 | 2.28 | 132 | 3 |", self.page)
        self.assertIn("| request and reply, rounded | 48 | 130.6 | 2.72 | – | – |", self.page)  # the paper has no such figure
        self.assertRegex(self.page, r"\| client and server of the localization, CLES \| \d+ \| \d+ \| 30 \|")
        self.assertIn("| 4 PC Threads, Laptop Request |", self.page)
        self.assertRegex(self.page, r"\| data to decision, median \| 10 \([\d.]+ to [\d.]+\) \| 10 \(")
        self.assertIn("5 strikes over each link", self.page)
        for shown in ("2026-01-02", "`abc1234`", "a processor, 2 cores", "It took 40 minutes.",
                      "The system did not allow a quota.", "4 threads"):
            self.assertIn(shown, self.page)

    def test_each_row_of_table_2_is_there_with_the_papers_figures(self):
        for name, ms in dsgd_figures.PAPER_MS.items():
            row = next(line for line in self.page.splitlines() if line.startswith(f"| {evaluation.TABLE2[name]} |"))
            self.assertIn(f"| {ms:,} |", row)

    def test_pages_read_well(self):
        for line in self.page.splitlines():
            self.assertEqual(line, line.rstrip())
            self.assertTrue(len(line) <= 130 or line.startswith(("|", "!")), line)
        self.assertNotRegex(self.page, r"None|nan|\n\n\n")
        self.assertEqual(len(re.findall(r"^!\[", self.page, re.MULTILINE)), len(evaluation.PICTURES))

    def test_what_does_not_show_how_fast_anything_is_gives_no_page(self):
        self.assertIn("latency: a quick run", self.refusal(latency={"quick": True}))
        self.assertIn("2 threads a host", self.refusal(dsgd={"threads": 2}))
        self.assertIn("other work kept 0.7 cores busy", self.refusal(bench={"machine": {**MACHINE, "busy_cores": 0.7}}))
        self.assertIn("two hosts: no root", self.refusal(latency={"skipped": ["two hosts: no root"]}))
        self.assertIn("cannot be shown", self.refusal(latency={"figures": []}))
        without = {name: raw for name, raw in RAWS.items() if name != "decision_latency"}
        with self.assertRaisesRegex(evaluation.Unfit, "decision_latency has not been measured"):
            evaluation.record_of(without, RUN)

    def test_digits_are_there_if_they_were_measured(self):
        self.assertNotIn("handwritten", self.page)
        raws = {**RAWS, evaluation.DIGITS: measured_digits()}
        page = evaluation.page_of(evaluation.record_of(raws, RUN))
        self.assertIn("| two nodes, a core each | 0.05 | 3,000 | 4 of 4 | 50 | 100 | 51,953 |", page)
        self.assertIn("| two nodes, each with few classes | 0.05 | 4,000 | 0 of 4 | – | 100 | 51,953 |", page)
        self.assertIn("Two nodes process 1.50 times as many images", page)
        with self.assertRaisesRegex(evaluation.Unfit, "digits_speed: a quick run"):
            evaluation.record_of({**raws, evaluation.DIGITS: {**measured_digits(), "drawn": True}}, RUN)

    def test_lines_are_counted_again(self):
        old = copy.deepcopy(self.record)
        old["figures"]["latency"]["cles_lines"]["value"] = 1
        old["figures"]["dsgd"]["lines_all"]["value"] = 1
        self.assertEqual(evaluation.files_of(evaluation.recounted(old)), evaluation.files_of(evaluation.recounted(self.record)))
        self.assertNotEqual(evaluation.page_of(old), self.page)

    @unittest.skipUnless(shutil.which("gnuplot"), "there is no gnuplot")
    def test_its_pictures_are_drawn(self):
        drawn = evaluation.pictures_of(RAWS)
        self.assertEqual(set(drawn), {f"{file}.svg" for _, _, file, _ in evaluation.PICTURES})
        for svg in drawn.values():
            self.assertTrue(ElementTree.fromstring(svg).tag.endswith("svg"))

    def test_the_command_writes_all_or_nothing(self):
        with tempfile.TemporaryDirectory(prefix="cles-evaluation-") as folder:
            raw, docs = Path(folder) / "raw", Path(folder) / "docs"
            raw.mkdir()
            docs.mkdir()
            for name, value in {**RAWS, "run": RUN}.items():
                (raw / f"{name}.json").write_text(json.dumps(value), encoding="utf-8")

            def evaluate(*arguments):
                return subprocess.run([sys.executable, "-B", str(ROOT / "scripts" / "evaluate"), *map(str, arguments)],
                                      capture_output=True, text=True, timeout=100, check=False, env={"PATH": "/nowhere"})

            done = evaluate("--from", raw, "-o", folder, "--docs", docs)
            self.assertEqual(done.returncode, 1)
            self.assertIn("cles: no picture fig3: there is no gnuplot", done.stderr)
            self.assertEqual(list(docs.iterdir()), [])
            self.assertEqual(evaluate("--recount", docs).returncode, 1)
            for name, text in evaluation.files_of(self.record).items():
                (docs / name).write_text("" if name == evaluation.PAGE else text, encoding="utf-8")
            done = evaluate("--recount", docs)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual((docs / evaluation.PAGE).read_text(encoding="utf-8"), self.page)
            for wrong in (("--docs", docs, "--quick"), ("--docs", "/nowhere"), ("--recount", docs, "--quick")):
                self.assertEqual(evaluate(*wrong).returncode, 2, wrong)


class Committed(unittest.TestCase):
    def test_the_page_is_that_of_its_record(self):
        record = ROOT / "docs" / evaluation.RECORD
        if not record.exists():
            self.assertFalse((ROOT / "docs" / evaluation.PAGE).exists(), "a page without a record")
            return
        found = json.loads(record.read_text(encoding="utf-8"))
        for name, text in evaluation.files_of(found).items():
            self.assertEqual((ROOT / "docs" / name).read_text(encoding="utf-8"), text, name)
        for _, _, file, _ in evaluation.shown_pictures(found["sections"]):
            self.assertTrue((ROOT / "docs" / f"{file}.svg").exists(), file)
        self.assertEqual(evaluation.recounted(found), found, "lines have changed: scripts/evaluate --recount docs")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
