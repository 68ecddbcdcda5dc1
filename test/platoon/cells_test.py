#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""However many updates are lost, vehicles with a radar do not collide: a fixed part of the drives of
perf/evaluation/platoon_cells.py, at each rate with each loss; and the gains of perf/evaluation/platoon_gains.py.

    cells_test.py SCRIPTS PROGRAMS SIMULATION
"""

import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SCRIPTS, PROGRAMS, SIMULATION = Path(sys.argv[1]), sys.argv[2], sys.argv[3]


def run(script, *arguments):
    """What it wrote, and what it printed."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "result.json"
        done = subprocess.run([sys.executable, "-B", SCRIPTS / script, "--programs", PROGRAMS, "-o", file, *map(str, arguments)],
                              capture_output=True, text=True, timeout=150, check=False)
        return done.returncode, json.loads(file.read_text(encoding="utf-8")), done.stdout + done.stderr


class Cells(unittest.TestCase):
    def test_nobody_collides_at_any_rate_with_any_loss(self):
        code, found, said = run("platoon_cells.py", "--seeds", 3, "--first-seed", 170, "--seconds", 20)
        self.assertEqual(code, 0, said)
        fleets = found["cells"]
        self.assertEqual([len(cells) for cells in fleets.values()], [51, 51])
        for cells in fleets.values():
            for cell in cells:
                self.assertGreater(cell["least_gap"], 0, cell)
        self.assertEqual({figure["name"]: figure["value"] for figure in found["figures"]}["collisions"], 0)
        without = [cell for cell in fleets["equal vehicles"] if (cell["loss_percent"], cell["burst"]) in ((0, 0), (10, 0))]
        self.assertEqual(len(without), 6)
        for cell in without:  # the gap does not open
            self.assertGreater(cell["least_gap"], 9, cell)
            self.assertLess(cell["string_ratio"], 1.02, cell)

    def test_the_failures_on_nodes(self):
        code, found, said = run("platoon_cells.py", "--failures", "--nodes", "--simulation", SIMULATION, "--seeds", 1, "--vehicles", 2,
                                "--seconds", 2, "--hz", 10)
        self.assertEqual(code, 0, said)
        self.assertEqual([(cell["hz"], cell["collisions"]) for cell in found["failures"]], [(10, 0)] * 4)
        self.assertRegex(said, r"(?m)^\| 10 % in bursts of 3; no radar \| 0\.0 % \(0\.0 to \d+\.\d\), \d\.\d\d, \d+\.\d m \|$")

    def test_the_gains_of_each_vehicle(self):
        code, found, said = run("platoon_gains.py", "--quick")
        self.assertEqual(code, 0, said)
        self.assertEqual(set(found["halves"]), {"braking", "recovery"})
        self.assertEqual(set(found["sines"]), {"4 s", "20 s"})
        for gains in (*found["halves"].values(), *found["sines"].values()):
            self.assertEqual([len(gains[kind]) for kind in ("error", "speed", "acceleration")], [3, 4, 4])
        self.assertIn("| 20 s | ", said)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
