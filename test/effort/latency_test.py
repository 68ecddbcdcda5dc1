#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the measurement of the paper's Fig. 3 in its quick form, and checks its output.

    latency_test.py FOLDER PROGRAMS

FOLDER holds the measurement, PROGRAMS the `cles` command.
"""

import contextlib
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

FOLDER, PROGRAMS = sys.argv[1], sys.argv[2]
sys.path[:0] = [FOLDER, str(Path(__file__).parents[1] / "perf")]
import interval  # noqa: E402
import latency  # noqa: E402
import linked_hosts  # noqa: E402
import reported  # noqa: E402
from run_within import run_within  # noqa: E402

LIMIT_S = 500  # less than it has, so that what was started is ended
KINDS = list(latency.KINDS)


@contextlib.contextmanager
def foreign_node():
    """An unrelated node on this host, which must not take part: in the default group on loopback, it has the name of
    the node that is measured, and publishes the same."""
    with subprocess.Popen([f"{PROGRAMS}/cles", "serve", "--name", "car1", "--listen", "tcp://127.0.0.1:0", "--multicast", "lo",
                           "--allow-clash", "--rate", "20"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, text=True) as process:
        try:
            if "listening" not in process.stdout.readline():
                raise AssertionError("the foreign node did not start")
            yield
        finally:
            process.kill()


class Latency(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as folder:
            output = Path(folder) / "latency.json"
            cls.mark = f"LATENCY_TEST={folder}"  # in the environment of all that is started
            with foreign_node():
                done = run_within(LIMIT_S, [sys.executable, "-B", f"{FOLDER}/latency.py", "--quick", "--programs", PROGRAMS,
                                            "-o", str(output)], env={**os.environ, "LATENCY_TEST": folder})
            if done.returncode != 0:
                raise AssertionError(done.stderr)
            cls.result = json.loads(output.read_text(encoding="utf-8"))
        cls.figures = {figure["name"]: figure for figure in cls.result["figures"]}

    def value(self, name):
        return self.figures[name]["value"]

    def need_links(self):
        if self.result["skipped"]:
            if os.environ.get("CI") == "true":
                self.fail(self.result["skipped"][0])
            self.skipTest(self.result["skipped"][0])

    def test_every_figure_says_what_it_is_and_how_sure(self):
        self.assertEqual(len(self.figures), len(self.result["figures"]))  # no name twice
        for figure in self.result["figures"]:
            self.assertEqual(set(figure), {"name", "what", "ran", "value", "low", "high", "unit", "paper", "target", "reached"})
            self.assertLessEqual(figure["low"], figure["high"], figure)
            self.assertEqual(figure["target"] is None, figure["reached"] is None, figure)

    def test_the_report_shows_it(self):
        reported.check(self, "latency", self.result)

    def test_loopback_is_measured(self):
        for kind in KINDS:
            for key in ("p50", "p99"):
                figure = self.figures[f"loopback_{kind.replace('-', '_')}_{key}"]
                self.assertGreater(figure["low"], 0)
        for kind in KINDS:
            self.assertEqual(len(self.result["series"]["loopback"][f"{kind}_p50_us"]), 3)
        self.assertEqual(self.figures["loopback_pull_ratio_p50"]["target"], "<= 1.1")
        self.assertEqual(self.figures["loopback_pull_overhead"]["paper"], 1500)

    def test_paced_pulls_are_compared_and_say_what_ran(self):
        for name, _, _, interval_ms in latency.LINKS:
            if name in self.result["links"]:
                for figure in (self.figures[f"{name}_pull_ratio_p50"], self.figures[f"{name}_pull_ratio_p99"]):
                    self.assertIn(f"both far ends only answer, one request every {interval_ms} ms", figure["ran"])

    def test_sizes_are_those_of_the_protocol(self):
        self.assertEqual((self.value("icd_reply_bytes"), self.value("icd_pull_bytes")), (44, 48))
        self.assertTrue(self.figures["reply_bytes"]["reached"], self.figures["reply_bytes"])
        self.assertGreater(self.value("reply_bytes"), 80)
        self.assertGreater(self.value("unrounded_reply_bytes"), self.value("reply_bytes") + 5 * 4)  # each value is longer
        self.assertEqual(self.value("unrounded_reply_bytes_ratio"), latency.rounded(self.value("unrounded_reply_bytes") / 44))
        for name in ("pull_bytes", "pull_bytes_ratio", "unrounded_pull_bytes"):  # the paper tells nothing of the same quantity
            self.assertIsNone(self.figures[name]["paper"], name)
        self.assertTrue(self.figures["cles_lines"]["reached"], self.figures["cles_lines"])
        self.assertGreater(self.value("lines_ratio"), 1)

    def test_each_link_is_as_bad_as_it_says(self):
        self.need_links()
        for name in ("lively", "paced", "cable", "wifi", "narrow"):
            for kind in KINDS:
                self.assertEqual([len(one) for one in self.result["series"][name][kind]], [8, 8, 8])
        # Two delays of 1.5 ms; and Ethernet frames of 70, 110 and 110 bytes at 8 bytes a millisecond, with 5 ms each.
        self.assertGreater(min(self.all_of("wifi", "icd-pull")), 3000)
        self.assertGreater(min(self.all_of("wifi", "icd-update")), 1500)
        self.assertGreater(min(self.all_of("wifi", "update-multicast")), 1500)
        self.assertGreater(min(self.all_of("narrow", "icd-pull")), 1e3 * (70 + 110) / 8 + 10_000)
        self.assertGreater(min(self.all_of("narrow", "icd-update")), 1e3 * 110 / 8 + 5_000)
        # A datagram saves the 24 bytes by which the headers of TCP are longer than UDP's.
        self.assertLess(self.value("narrow_update_multicast_p50"), self.value("narrow_update_p50"))
        self.assertLess(self.value("cable_icd_pull_p50"), self.value("wifi_icd_pull_p50"))

    def all_of(self, name, kind):
        return [us for one in self.result["series"][name][kind] for us in one]

    def test_nothing_is_left_behind(self):
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                self.assertNotIn(self.mark.encode(), (folder / "environ").read_bytes().split(b"\0"))
            except OSError:
                continue  # it has ended meanwhile, or is not ours


class FarEnds(unittest.TestCase):
    """The two that answer PULLs do the same, so that their latencies can be compared."""

    def setUp(self):
        self.hosts = self.enterContext(linked_hosts.OneHost())
        self.program = str(Path(PROGRAMS).parent / "perf" / "links" / "cles_link_latency")

    def far_end(self, kind):
        return self.enterContext(self.hosts.running("far", self.program, "serve", kind, "tcp://127.0.0.1:0", "--interval", "1"))

    def timed(self, kind, url, count):
        return subprocess.run([self.program, "time", kind, url, "--count", str(count), "--interval", "1"], capture_output=True,
                              text=True, timeout=60, check=False)

    @staticmethod
    def wake_ups(process):
        status = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
        return int(re.search(r"^voluntary_ctxt_switches:\s*(\d+)", status, re.MULTILINE)[1])

    def test_both_sleep_unless_they_are_asked(self):
        publisher = self.far_end("icd-update")
        for kind in ("pull", "icd-pull"):
            with self.subTest(kind):
                url = self.far_end(kind)
                process = self.hosts.processes[-1]
                self.assertEqual(len(json.loads(self.timed(kind, url, 1).stdout)), 1)
                before = self.wake_ups(process)
                self.assertEqual(len(json.loads(self.timed("icd-update", publisher, 200).stdout)), 200)  # takes 200 ms
                self.assertLess(self.wake_ups(process) - before, 20)

    def test_the_one_that_answers_publishes_nothing(self):
        refused = self.timed("update", self.far_end("pull"), 1)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("no_task", refused.stderr)

    def test_the_one_that_publishes_answers_nothing(self):
        refused = self.timed("pull", self.far_end("update"), 1)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("no_task", refused.stderr)


class Statistics(unittest.TestCase):
    def test_a_quantile_is_one_of_the_values(self):
        values = [float(i) for i in range(100, 0, -1)]
        self.assertEqual([interval.quantile(values, share) for share in (0.5, 0.99, 1.0, 0.0)], [50, 99, 100, 1])
        self.assertEqual(interval.quantile([7.0], 0.99), 7.0)

    def test_an_interval_over_rounds_holds_the_statistic_and_keeps_rounds_whole(self):
        # Two exchanges that a disturbance slows equally: each varies, their ratio does not.
        rounds = [{"a": 10.0 * i, "b": 20.0 * i} for i in range(1, 20)]
        low, high = interval.interval_over(rounds, lambda some: sum(one["a"] for one in some) / len(some))
        self.assertTrue(low < 100 < high, (low, high))
        ratio = interval.interval_over(rounds, lambda some: sum(o["b"] for o in some) / sum(o["a"] for o in some))
        self.assertEqual(ratio, (2.0, 2.0))

    def test_what_misses_its_target_is_told(self):
        figures = latency.Figures()
        figures.add("a", "what", 1.2, "times", at_most=1.1)
        figures.add("b", "what", 1.1, "times", at_most=1.1)
        self.assertEqual([figure["reached"] for figure in figures.found], [False, True])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
