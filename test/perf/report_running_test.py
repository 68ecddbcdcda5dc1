#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""How `scripts/evaluate` runs its sections: those that work, fail, hang, print nothing, or are missing.

In a tree of its own, whose measuring scripts are a few lines each.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "perf")]
from report import running  # noqa: E402
from run_within import run_within  # noqa: E402

WORKS = """#!/usr/bin/env python3
import json, sys
print("\\rhalf done", end="", file=sys.stderr)
output = sys.argv[sys.argv.index("-o") + 1]
figure = {"name": "a", "what": "words " + " ".join(sys.argv[1:]), "value": 1, "unit": "us"}
json.dump({"title": "t", "command": "c", "machine": "m", "date": "d", "figures": [figure]}, open(output, "w"))
"""
FAILS = """import sys
print("begun", file=sys.stderr)
print("the road is closed", file=sys.stderr)
sys.exit(7)
"""
DISAGREES = WORKS + "print('\\nthey differ', file=sys.stderr)\nsys.exit(1)\n"
IDLE = "import sys\nif '--help' not in sys.argv:\n    print('no road was built', file=sys.stderr)\n    sys.exit(77)\n"
SILENT = "import sys\n"
BROKEN = "import sys\nif '--help' not in sys.argv:\n    open(sys.argv[-1], 'w').write('[1, 2')\n"
HANGS = """import os, subprocess, sys, time
if "--help" not in sys.argv:
    child = subprocess.Popen(["sleep", "1000"])
    print("child", child.pid, file=sys.stderr, flush=True)
    time.sleep(1000)
"""
LEAVES = """import subprocess, sys
if "--help" not in sys.argv:
    child = subprocess.Popen(["sleep", "1000"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    print("child", child.pid, file=sys.stderr)
    sys.exit(1)
"""


WATCHED = "seconds=1.0"  # for so long, other work is looked for first; here that would be most of the time


def is_alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


class Tree:
    """The program, its modules, and the sections of a test."""

    def __init__(self, test, **scripts):
        holder = tempfile.TemporaryDirectory(prefix="cles-evaluate-")
        test.addCleanup(holder.cleanup)
        self.root = Path(holder.name)
        self.build = self.root / "build" / "other"
        (self.build / "apps").mkdir(parents=True)
        (self.root / "perf" / "evaluation").mkdir(parents=True)
        (self.root / "scripts").mkdir()
        shutil.copy(ROOT / "scripts" / "evaluate", self.root / "scripts" / "evaluate")
        shutil.copytree(ROOT / "perf" / "report", self.root / "perf" / "report", ignore=shutil.ignore_patterns("__pycache__"))
        provenance = (ROOT / "perf" / "evaluation" / "provenance.py").read_text(encoding="utf-8")
        test.assertEqual(provenance.count(WATCHED), 1)
        (self.root / "perf" / "evaluation" / "provenance.py").write_text(provenance.replace(WATCHED, "seconds=0.02"),
                                                                         encoding="utf-8")
        for name, text in scripts.items():
            path = self.script(name)
            path.write_text(text, encoding="utf-8")
            path.chmod(0o755)

    def script(self, name):
        return self.root / "perf" / "evaluation" / f"{name}.py"

    def command(self, *arguments, build=True):
        chosen = ["--build", str(self.build)] if build else []
        return [sys.executable, "-B", str(self.root / "scripts" / "evaluate"), *chosen, *arguments]

    def evaluate(self, *arguments, build=True):
        return run_within(120, self.command(*arguments, build=build))

    def report(self, name):
        return self.root / "build" / "report" / name

    def run(self):
        return json.loads(self.report("raw/run.json").read_text(encoding="utf-8"))


class Sections(unittest.TestCase):
    def test_one_that_fails_does_not_stop_the_others(self):
        tree = Tree(self, bench=FAILS, dsgd=WORKS, later=WORKS)
        done = tree.evaluate("--quick")
        self.assertEqual(done.returncode, 1, done.stderr)
        states = {name: told["state"] for name, told in tree.run()["sections"].items()}
        self.assertEqual((states["bench"], states["dsgd"], states["later"], states["platoon"]),
                         ("failed", "ran", "ran", "skipped"))
        self.assertIn("the road is closed", tree.run()["sections"]["bench"]["reason"])
        self.assertIn("half done", done.stderr)
        self.assertIn("dsgd: ran", done.stderr)
        page = tree.report("index.html").read_text(encoding="utf-8")
        self.assertIn("perf/evaluation/bench.py ended with 7: the road is closed", page)
        self.assertIn("there is no perf/evaluation/platoon.py", page)
        self.assertIn("words --quick -o build/report/raw/later.json", page)

    def test_what_is_not_there_is_a_failure_only_if_asked(self):
        self.assertEqual(Tree(self, bench=WORKS).evaluate("--only", "bench").returncode, 0)
        self.assertEqual(Tree(self, bench=WORKS).evaluate("--strict").returncode, 1)

    def test_only_one_keeps_the_others_of_before(self):
        tree = Tree(self, bench=WORKS, dsgd=WORKS)
        self.assertEqual(tree.evaluate().returncode, 0)
        tree.script("dsgd").write_text(FAILS, encoding="utf-8")
        self.assertEqual(tree.evaluate("--only", "bench").returncode, 0)
        self.assertEqual(tree.run()["sections"]["dsgd"]["state"], "kept")
        self.assertIn("figures of an earlier one", tree.report("index.html").read_text(encoding="utf-8"))
        self.assertEqual(tree.evaluate("--only", "dsgd").returncode, 1)
        self.assertFalse(tree.report("raw/dsgd.json").exists())

    def test_figures_stay_where_a_script_finds_fault_with_them(self):
        tree = Tree(self, bench=DISAGREES)
        self.assertEqual(tree.evaluate("--only", "bench").returncode, 1)
        page = tree.report("index.html").read_text(encoding="utf-8")
        self.assertIn("ended with 1: they differ", page)
        self.assertIn("words -o", page)

    def test_what_is_told_to_end_ends_what_it_runs(self):
        tree = Tree(self, bench=HANGS)
        with subprocess.Popen(tree.command("--only", "bench"), stderr=subprocess.PIPE, text=True) as process:
            child = next(line.split()[-1] for line in process.stderr if "child" in line)
            process.terminate()
            self.assertEqual(process.wait(60), 143)
        self.assertFalse(is_alive(int(child)))

    def test_what_takes_too_long_is_told_to_end(self):
        with self.assertRaisesRegex(AssertionError, "did not end in 0.1 s"):
            run_within(0.1, ["sleep", "1000"])

    def test_programs_are_those_of_the_build_where_a_script_asks(self):
        asks = "import sys\nif '--help' in sys.argv:\n    print('--programs'); sys.exit()\n" + WORKS
        tree = Tree(self, bench=asks)
        self.assertEqual(tree.evaluate("--only", "bench").returncode, 0)
        self.assertIn("words --programs build/other/apps -o", tree.report("index.html").read_text(encoding="utf-8"))


class One(unittest.TestCase):
    def outcome(self, text, limit_s=60.0):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        script, self.output = os.path.join(holder.name, "it.py"), os.path.join(holder.name, "it.json")
        Path(script).write_text(text, encoding="utf-8")
        return running.run(script, self.output, False, "apps", limit_s, running.Progress())

    def test_what_writes_nothing_or_no_json_has_failed(self):
        for text, says in ((SILENT, "no output"), (BROKEN, "wrote no JSON")):
            found = self.outcome(text)
            self.assertEqual(found.state, running.FAILED)
            self.assertIn(says, found.reason)
            self.assertFalse(os.path.exists(self.output))

    def test_what_hangs_is_stopped_with_all_that_it_started(self):
        found = self.outcome(HANGS, 2.0)
        self.assertEqual(found.state, running.FAILED)
        self.assertIn("stopped after 2 s; last: child", found.reason)
        self.assertFalse(is_alive(int(found.reason.split()[-1])))

    def test_what_ends_takes_along_what_it_has_left_behind(self):
        found = self.outcome(LEAVES)
        self.assertEqual(found.state, running.FAILED)
        self.assertIn("ended with 1: child", found.reason)
        self.assertFalse(is_alive(int(found.reason.split()[-1])))

    def test_what_is_not_there_is_skipped(self):
        found = running.run("nowhere/it.py", "nowhere/it.json", False, "apps", 1.0, running.Progress())
        self.assertEqual((found.state, found.reason), (running.SKIPPED, "there is no nowhere/it.py"))

    def test_what_finds_nothing_to_measure_is_skipped(self):
        found = self.outcome(IDLE)
        self.assertEqual((found.state, found.reason), (running.SKIPPED, "no road was built"))


class Usage(unittest.TestCase):
    def test_what_makes_no_sense_is_refused(self):
        tree = Tree(self, bench=WORKS)
        for arguments in (["--only", "pigeons"], ["--from", "nowhere"], ["--pictures", "nowhere"], ["--fast"],
                          ["--from", str(tree.root), "--quick"]):
            done = tree.evaluate(*arguments, build=False)
            self.assertEqual(done.returncode, 2, (arguments, done.stderr))
            self.assertIn("scripts/evaluate: error", done.stderr)
            self.assertFalse(tree.report("index.html").exists())

    def test_help_names_the_sections(self):
        done = Tree(self, bench=WORKS, later=WORKS).evaluate("--help")
        self.assertEqual(done.returncode, 0)
        for name in ("bench", "dsgd", "platoon", "later", "--quick", "--from"):
            self.assertIn(name, done.stdout)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
