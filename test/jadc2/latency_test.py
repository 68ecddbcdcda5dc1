#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the measurement of strike orders in its quick form, and checks its output and that it leaves nothing behind.

    latency_test.py FOLDER PROGRAMS

FOLDER holds the measurement, PROGRAMS `clesd` and `cles-jadc2`.
"""

import json
import os
import re
import select
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

FOLDER, PROGRAMS = sys.argv[1], sys.argv[2]
sys.path[:0] = [FOLDER, str(Path(__file__).parents[1] / "perf")]
import reported  # noqa: E402
import strike_latency  # noqa: E402


class Latency(unittest.TestCase):
    def test_idle_and_loaded_are_measured(self):
        with tempfile.TemporaryDirectory() as folder:
            output = Path(folder) / "strike.json"
            done = subprocess.run([sys.executable, "-B", f"{FOLDER}/strike_latency.py", "--quick", "--programs", PROGRAMS,
                                   "-o", str(output)], capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            result = json.loads(output.read_text(encoding="utf-8"))
        reported.check(self, "strike_latency", result)
        self.assertEqual(set(result["rounds"]), {"urgent", "default"})
        for setup in ("urgent", "default"):
            for round_ in result["rounds"][setup]["idle"] + result["rounds"][setup]["loaded"]:
                self.assertEqual(round_["count"], 200)
                self.assertGreater(round_["p50_us"], 0)
                self.assertLessEqual(round_["p50_us"], round_["p99_us"])
                self.assertLessEqual(round_["p99_us"], round_["max_us"])
        figures = {each["name"]: each for each in result["figures"]}
        self.assertTrue(all(each["value"] > 0 and each["runs"] == 2 for each in figures.values()), figures)
        for prefix, setup in (("strike_", "urgent"), ("strike_default_", "default")):
            ratio = figures[f"{prefix}ratio"]
            self.assertEqual(ratio["reached"], ratio["value"] <= 2)
            self.assertRegex(result["setups"][setup], "priority.*, [0-9]+ workers? on [0-9]+ cores?, .*polling")
            for name in ("idle_p50", "idle_p99", "loaded_p50", "loaded_p99", "ratio", "frames", "frame_run"):
                self.assertIn(result["setups"][setup], figures[prefix + name]["what"])
        self.assertRegex(result["setups"]["default"], "^no priority, .*, no polling$")
        for text in result["setups"].values():
            self.assertIn(text, figures["strike_urgent_to_default"]["ran"])
        self.assertTrue({"title", "command", "machine", "date", "quick"} <= result.keys())

    def test_the_node_has_the_settings_that_are_told(self):
        setup = strike_latency.Setup(workers=3, real_time=20, busy_poll=50)
        self.assertEqual(setup.text(4), "SCHED_FIFO priority 20, 3 workers on 4 cores, polling for 50 us")
        self.assertEqual(self.shown_by_daemon(setup), {"workers": "3", "real_time": "20", "busy_poll": "50us"})
        defaults = strike_latency.Setup()
        self.assertEqual(self.shown_by_daemon(defaults),
                         {"workers": str(os.cpu_count()), "real_time": "0", "busy_poll": "0"})
        self.assertRegex(defaults.text(4), f"^no priority, {os.cpu_count()} workers? on 4 cores, no polling$")

    def shown_by_daemon(self, setup):
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
            file.write("node: node\n" + setup.yaml())
            file.flush()
            shown = subprocess.run([f"{PROGRAMS}/clesd", "--config", file.name, "--print-config"], capture_output=True, text=True,
                                   check=True).stdout
        return dict(re.findall("^(workers|real_time|busy_poll): *(\\S+)", shown, re.MULTILINE))

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
