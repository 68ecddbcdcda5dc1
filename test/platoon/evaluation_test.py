#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A short evaluation and its plots: that the report is complete.

    evaluation_test.py SCRIPTS PROGRAMS
"""

import json
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree
from pathlib import Path

SCRIPTS, PROGRAMS = Path(sys.argv[1]), sys.argv[2]
sys.path[:0] = [str(SCRIPTS), str(Path(__file__).parents[1] / "perf")]
import platoon  # noqa: E402
import reported  # noqa: E402


class Evaluation(unittest.TestCase):
    def test_it_tells_all_and_draws_it(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "platoon.json"
            subprocess.run([sys.executable, "-B", SCRIPTS / "platoon.py", "--quick", "--programs", PROGRAMS, "-o", file,
                            "--plots", folder], check=True, timeout=150)
            result = json.loads(file.read_text(encoding="utf-8"))
            plots = list(Path(folder).glob("*/*.svg"))
            for plot in plots:
                drawn = xml.etree.ElementTree.parse(plot).getroot()
                self.assertGreaterEqual(len(drawn.findall(".//{http://www.w3.org/2000/svg}polyline")), 1, plot)
        self.assertEqual({plot.name for plot in plots}, {"speed.svg", "error.svg", "latency.svg"})
        reported.check(self, "platoon", result)
        self.assertEqual(len(result["simulated"]), 18)
        figures = {figure["name"]: figure for figure in result["figures"]}
        self.assertEqual(figures["string_ratio_leader_50"]["value"], result["checks"]["string_ratio"]["50 Hz"])
        self.assertEqual(figures["nobody_collides"]["reached"], True)
        self.assertEqual([picture["name"] for picture in result["pictures"]], ["speed", "error", "latency"])
        for picture in result["pictures"]:
            xml.etree.ElementTree.fromstring(picture["svg"])
        self.assertTrue({"title", "date", "command", "machine"} <= result.keys())
        self.assertTrue(all(len(row["ratios"]) == (2 if row["loss_percent"] else 1) for row in result["simulated"]))
        self.assertEqual(figures["string_failures_leader_10_bursts"]["runs"], 2)
        self.assertTrue(result["checks"]["nobody_collides"])
        self.assertGreater(result["driven"][0]["latency"]["count"], 0)
        self.assertEqual(result["killed"][0]["killed"], 1)
        self.assertIn("gone", [event["mode"] for event in result["killed"][0]["events"]])

    def test_of_several_drives_the_median_counts(self):
        def drive(hz, loss, p999_us):
            return {"hz": hz, "loss_percent": loss, "collision": False, "latency": {"p999_us": p999_us, "late": 0}}

        drives = [drive(25, 0, 9e6), drive(50, 0, 1500), drive(50, 10.0, 2500), drive(50, 0, 5000), drive(50, 10.0, 2100),
                  drive(50, 0, 500), drive(50, 10.0, 100)]
        checks = platoon.checks_of([], drives, [])
        self.assertEqual(checks["p999_ms_at_50_hz"], {"0": [0.5, 1.5, 5.0], "10": [0.1, 2.1, 2.5]})
        self.assertFalse(checks["p999_reached"])
        found = {each["name"]: each for each in platoon.figures_of(checks, [], drives)}
        self.assertEqual((found["p999_50_hz_0"]["value"], found["p999_50_hz_0"]["reached"]), (1.5, True))
        self.assertEqual((found["p999_50_hz_10"]["value"], found["p999_50_hz_10"]["reached"]), (2.1, False))
        self.assertEqual((found["p999_50_hz_10"]["low"], found["p999_50_hz_10"]["high"]), (0.1, 2.5))

    def test_the_pictures_of_the_page_can_be_drawn(self):
        with tempfile.TemporaryDirectory() as folder:
            figures = Path(folder) / "figures.json"
            subprocess.run([sys.executable, "-B", SCRIPTS / "platoon_pictures.py", "--seeds", "1", "--programs", PROGRAMS, "-o",
                            folder, "--figures", figures], check=True, timeout=150)
            found = json.loads(figures.read_text(encoding="utf-8"))
            drawn = {path.stem.removeprefix("platoon_"): xml.etree.ElementTree.parse(path).getroot()
                     for path in Path(folder).glob("*.svg")}
        self.assertEqual(set(drawn), {"track", "failures", "bursts", "degradation", "differences", "mixed", "merge", "split"})
        self.assertEqual(len(drawn["mixed"].findall(".//{http://www.w3.org/2000/svg}circle")), 9)
        self.assertEqual(len(found["failures"]["10 % lost"]), 3)
        lines = {name: len(root.findall(".//{http://www.w3.org/2000/svg}polyline")) for name, root in drawn.items()}
        self.assertGreaterEqual(lines["degradation"], 5)
        self.assertEqual(lines["merge"], 6)  # with the vehicle that merges
        self.assertGreaterEqual(len(drawn["failures"].findall(".//{http://www.w3.org/2000/svg}circle")), 12)

    def test_a_record_that_is_none(self):
        with tempfile.TemporaryDirectory() as folder:
            for text in ("", "{}", "[1]"):
                file = Path(folder) / "record.json"
                file.write_text(text, encoding="utf-8")
                done = subprocess.run([sys.executable, "-B", SCRIPTS / "platoon_plot.py", file, "-o", folder],
                                      capture_output=True, text=True, check=False)
                self.assertEqual(done.returncode, 1, text)
                self.assertRegex(done.stderr, r"^platoon_plot\.py: ")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
