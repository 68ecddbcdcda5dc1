#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the measurement of strike orders in its quick form, and checks its output and that it leaves nothing behind.

    latency_test.py FOLDER PROGRAMS

FOLDER holds the measurement, PROGRAMS `clesd` and `cles-jadc2`.
"""

import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

FOLDER, PROGRAMS = sys.argv[1], sys.argv[2]
sys.path.insert(0, str(Path(__file__).parents[1] / "perf"))
import reported  # noqa: E402


class Latency(unittest.TestCase):
    def test_idle_and_loaded_are_measured(self):
        with tempfile.TemporaryDirectory() as folder:
            output = Path(folder) / "strike.json"
            done = subprocess.run([sys.executable, "-B", f"{FOLDER}/strike_latency.py", "--quick", "--programs", PROGRAMS,
                                   "-o", str(output)], capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            result = json.loads(output.read_text(encoding="utf-8"))
        reported.check(self, "strike_latency", result)
        for state in ("idle", "loaded"):
            for round_ in result["rounds"][state]:
                self.assertEqual(round_["count"], 200)
                self.assertGreater(round_["p50_us"], 0)
                self.assertLessEqual(round_["p50_us"], round_["p99_us"])
                self.assertLessEqual(round_["p99_us"], round_["max_us"])
        figures = {each["name"]: each for each in result["figures"]}
        self.assertTrue(all(each["value"] > 0 and each["runs"] == 2 for each in figures.values()), figures)
        self.assertEqual(figures["strike_ratio"]["reached"], figures["strike_ratio"]["value"] <= 2)
        self.assertIn("frames", figures)
        self.assertTrue({"title", "command", "machine", "date", "quick"} <= result.keys())

    def test_told_to_end_while_the_node_starts_it_leaves_nothing(self):
        with tempfile.TemporaryDirectory() as folder:
            programs, files, told = Path(folder, "programs"), Path(folder, "files"), Path(folder, "told")
            programs.mkdir()
            files.mkdir()
            os.mkfifo(told)
            (programs / "clesd").write_text(f"#!/bin/sh\necho $$ > {told}\nexec sleep 300\n", encoding="utf-8")  # hangs
            (programs / "clesd").chmod(0o755)
            reader = os.open(told, os.O_RDONLY | os.O_NONBLOCK)
            with subprocess.Popen([sys.executable, "-B", f"{FOLDER}/strike_latency.py", "--programs", programs],
                                  stdin=subprocess.DEVNULL, env={**os.environ, "TMPDIR": str(files)}) as script:
                self.assertTrue(select.select([reader], [], [], 30)[0], "no node was started")
                node = int(os.read(reader, 100))
                os.close(reader)
                script.send_signal(signal.SIGTERM)
                self.assertEqual(script.wait(30), 143)
            self.assertRaises(ProcessLookupError, os.kill, node, 0)  # it was waited for
            self.assertEqual(list(files.iterdir()), [])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
