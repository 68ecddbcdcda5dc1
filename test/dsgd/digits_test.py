#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Distributed descent on digits as its users run it: daemons that have files of their own and a manager of rounds, and nodes
that average with their neighbours. The digits are drawn by scripts/digits, so that nothing is needed."""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from processes_test import HANGING, live_at, kill, node, run, start
from support import finish, read_line, wait_until

SCRIPT = os.environ["DIGITS_SCRIPT"]
PLUGIN = os.environ["DIGITS_PLUGIN"]
ROUNDS = "40"


class Files:
    """Files for workers, and one to test with."""

    def __init__(self, workers, *more):
        self.folder = tempfile.mkdtemp(prefix="digits-")
        self.printed = subprocess.run([sys.executable, "-B", SCRIPT, self.folder, "--workers", str(workers), "--drawn",
                                       *more], check=True, capture_output=True, text=True).stdout
        self.test = os.path.join(self.folder, "test.csv")

    def of(self, worker):
        return os.path.join(self.folder, f"worker{worker}.csv")

    def plugin(self, worker):
        return f"plugins: [{{path: {PLUGIN}, config: {{files: [{self.of(worker)}]}}}}]\n"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        shutil.rmtree(self.folder)


def images_in(path):
    return Path(path).read_text(encoding="ascii").splitlines()[1:]


def rounds_without_late(report):
    """How many rounds ended before a node was late in one."""
    return next((place for place, each in enumerate(report["course"]) if each["late"] or len(each["nodes"]) < 2),
                len(report["course"]))


def ring(case, files, count, *more):
    """Nodes that each average with the one before and the one after."""
    processes, seeds = [], []
    for k in range(count):
        neighbours = sorted({f"n{(k - 1) % count + 1}", f"n{(k + 1) % count + 1}"})
        processes.append(start("neighbours", "--name", f"n{k + 1}", "--neighbours", ",".join(neighbours), "--files",
                               files.of(k + 1), "--test", files.test, *seeds, *more))
        case.addCleanup(processes[-1].kill)
        if not seeds:
            line = read_line(processes[0], processes[0].stderr if "--json" in more else processes[0].stdout)
            found = re.match(r"n1 listening on (tcp://127\.0\.0\.1:\d+)\n$", line)
            case.assertTrue(found, line)
            seeds = ["--at", found[1]]
    return processes


class Digits(unittest.TestCase):
    def check(self, arguments, code=0):
        """The object that it prints, and stderr."""
        ended, out, err = run(*arguments, "--json")
        self.assertEqual(ended, code, err)
        return json.loads(out), err

    def nodes(self, files, count):
        """Daemons that know each other, each with files of its own."""
        daemons = []
        for worker in range(1, count + 1):
            seeds = [daemons[0].url] if daemons else []
            daemons.append(node(f"sat{worker}", *seeds, plugin=files.plugin(worker)).__enter__())
            self.addCleanup(daemons[-1].__exit__)
        for daemon in daemons:
            wait_until(lambda at=daemon: len(live_at(at)) == count - 1, "they know each other")
        return daemons

    # -- files -----------------------------------------------------------------------------------------------------------

    def test_files_are_divided(self):
        with Files(4) as files, Files(4) as again, Files(4, "--non-iid") as non_iid:
            parts = [images_in(files.of(worker)) for worker in range(1, 5)]
            self.assertEqual([len(part) for part in parts], [200] * 4)
            self.assertEqual(len(images_in(files.test)), 200)
            self.assertEqual(parts, [images_in(again.of(worker)) for worker in range(1, 5)])
            others = [images_in(non_iid.of(worker)) for worker in range(1, 5)]
            self.assertEqual(sorted(sum(parts, [])), sorted(sum(others, [])))
            self.assertEqual(images_in(files.test), images_in(non_iid.test))
            classes = [{line.rsplit(",", 1)[1] for line in part} for part in others]
            self.assertTrue(all(len(each) < 10 for each in classes), classes)
            self.assertEqual(len(set().union(*classes)), 10)
            self.assertRegex(files.printed, r"(?m)^worker4: 200 images; of each digit:( \d+){10}$")

    # -- rounds ----------------------------------------------------------------------------------------------------------

    def test_rounds_learn_what_one_thread_does(self):
        with Files(2) as files:
            first, _ = self.nodes(files, 2)
            here, _ = self.check(["rounds", "--local", f"{files.of(1)},{files.of(2)}", "--test", files.test, "--rounds", ROUNDS])
            self.assertEqual(first.ask("PULL self:digits"), '{"images":400,"pixels":64,"classes":10}')
            report, err = self.check(["rounds", "--at", first.url, "--test", files.test, "--rounds", ROUNDS])
            again, _ = self.check(["rounds", "--at", first.url, "--test", files.test, "--rounds", ROUNDS, "-n", "sat2,sat1"])
        self.assertEqual(report["rounds"], int(ROUNDS))
        if rounds_without_late(report) == int(ROUNDS):
            self.assertEqual(err, "")
            self.assertEqual(report["images"], 800 * int(ROUNDS))
            # Two networks of 4810 weights to the nodes, and two back; base64 makes four bytes of three.
            self.assertEqual(report["bytes_per_round"], 2 * 2 * 4 * -(-4810 * 4 // 3))
        same = min(map(rounds_without_late, (report, again)))  # all, unless the machine is busy
        self.assertEqual([each["nodes"] for each in report["course"][:same]], [["sat1", "sat2"]] * same)
        self.assertEqual([each["accuracy"] for each in report["accuracies"][:same]],
                         [each["accuracy"] for each in again["accuracies"][:same]])
        self.assertGreater(report["accuracy"], here["accuracy"] - 0.02)

    def test_each_pass_counts(self):
        with Files(1) as files:
            (daemon,) = self.nodes(files, 1)
            for where in (["--at", daemon.url], ["--local", files.of(1)]):
                report, _ = self.check(["rounds", *where, "--test", files.test, "--rounds", "3", "--passes", "2"], 7)
                self.assertEqual(report["images"], 800 * 2 * 3, where)

    def test_images_of_few_classes_are_enough_together(self):
        with Files(4, "--non-iid") as files:
            alone, err = self.check(["rounds", "--local", files.of(1), "--test", files.test, "--rounds", ROUNDS], 7)
            self.assertIn("the result is not good: its accuracy is", err)
            self.assertIn(alone["shortcoming"], err)
            first, *_ = self.nodes(files, 4)
            code, out, err = run("rounds", "--at", first.url, "--test", files.test, "--rounds", "60", "--json")
            self.assertIn(code, (0, 7), err)
            self.assertGreater(json.loads(out)["accuracy"], 0.85)

    def test_for_people_it_prints_lines(self):
        with Files(1) as files:
            (daemon,) = self.nodes(files, 1)
            code, out, err = run("rounds", "--at", daemon.url, "--test", files.test, "--rounds", ROUNDS, "--evaluate", "3")
        self.assertEqual(code, 0, err)
        self.assertRegex(out, r"(?m)^round +3 +1 nodes +loss +\d\.\d{5} +accuracy +\d+\.\d\d % +after +\d+\.\d{3} ms$")
        self.assertRegex(out, r"(?m)^elapsed +\d+\.\d{3} ms: \d+ images per second, \d+ bytes per round$")
        self.assertRegex(out, r"(?m)^accuracy +\d+\.\d\d %; best known \d+\.\d\d %$")

    def test_what_has_not_converged_is_told(self):
        with Files(1) as files:
            report, err = self.check(["rounds", "--local", files.of(1), "--test", files.test, "--rounds", "12", "--rate",
                                      "0.002"], 7)
            self.assertIn("the training has not converged: ", err)
            self.assertIn(report["shortcoming"], err)
            _, err = self.check(["rounds", "--local", files.of(1), "--test", files.test, "--rounds", "3"], 7)
            self.assertIn("it is not known whether the training has converged: ", err)
            code, out, err = run("rounds", "--local", files.of(1), "--test", files.test, "--rate", "900")
            self.assertEqual((code, out, err), (5, "", "cles-dsgd: it does not converge: the rate is too large\n"))

    def test_the_others_go_on_without_a_killed_node_and_with_one_that_joins(self):
        with Files(3) as files:
            first, second = self.nodes(files, 2)
            manager = start("rounds", "--at", first.url, "--test", files.test, "--rounds", "2000", "--evaluate", "20")
            read_line(manager)
            kill(second)
            self.assertRegex(read_line(manager, manager.stderr), r"^cles-dsgd: round \d+: sat2: unavailable: .*; the others go on$")
            with node("sat3", first.url, plugin=files.plugin(3)):
                self.assertEqual(read_line(manager, manager.stderr), "cles-dsgd: sat3 takes part from now on\n")
                line = ""
                while " 2 nodes " not in line:
                    line = read_line(manager)
                    self.assertNotEqual(line, "")
                manager.kill()
                manager.communicate()

    def test_where_nobody_is_left_it_fails(self):
        with Files(1) as files:
            (daemon,) = self.nodes(files, 1)
            manager = start("rounds", "--at", daemon.url, "--test", files.test, "--rounds", "100000", "--evaluate", "100")
            read_line(manager)
            kill(daemon)
            code, _, err = finish(manager)
        self.assertEqual(code, 5, err)
        self.assertRegex(err, "(?m)^cles-dsgd: sat1: unavailable: ")

    def test_what_is_missing_is_told(self):
        with Files(1) as files:
            self.assertEqual(run("rounds", "--at", "tcp://127.0.0.1:1", "--test", files.test),
                             (3, "", "cles-dsgd: no node answers at the given address (--at): is clesd running there?\n"))
            code, out, err = run("rounds", "--test", "/nonexistent")
            self.assertEqual((code, out, err), (5, "", "cles-dsgd: /nonexistent: it cannot be read\n"))
            with node("sat1", plugin=f"plugins: [{HANGING}]\n") as daemon:
                code, out, err = run("rounds", "--at", daemon.url, "--test", files.test)
            self.assertEqual((code, out), (3, ""))
            self.assertIn("is libcles-digits.so among the plugins of a node?", err)
            (daemon,) = self.nodes(files, 1)
            code, out, err = run("rounds", "--at", daemon.url, "--test", files.test, "--nodes", "sat9")
            self.assertEqual((code, out, err), (3, "", "cles-dsgd: 'sat9' does not offer 'digits': see cles ls --tasks\n"))
        for arguments in (["rounds"], ["rounds", "--test", "x", "--rounds", "0"], ["rounds", "--test", "x", "--local", "y", "--at",
                          "tcp://127.0.0.1:1"], ["neighbours"], ["neighbours", "--name", "a"], ["rounds", "--test", "x", "--rate", "nan"]):
            code, out, err = run(*arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertNotEqual(err, "")

    # -- neighbours ------------------------------------------------------------------------------------------------------

    def test_a_ring_learns_without_a_manager(self):
        with Files(4, "--non-iid") as files:
            ended = [finish(each) for each in ring(self, files, 4, "--rounds", "80", "--rate", "0.02", "--json")]
        reports = []
        for code, out, err in ended:
            self.assertIn(code, (0, 7), err)  # the data is hard; what is checked follows
            reports.append(json.loads(out))
        for report in reports:
            self.assertEqual(report["error"], "")
            self.assertEqual(report["rounds"], 80)
            self.assertEqual(len(report["course"][-1]["nodes"]), 3, report["course"][-1])
            self.assertGreater(report["accuracy"], 0.8)

    def test_a_network_of_another_shape_is_told_once(self):
        with Files(2) as files:
            common = ["--test", files.test, "--rounds", "6", "--patience", "3"]
            first = start("neighbours", "--name", "n1", "--neighbours", "n2", "--files", files.of(1), *common)
            self.addCleanup(first.kill)
            url = read_line(first).split()[-1]
            second = start("neighbours", "--name", "n2", "--neighbours", "n1", "--files", files.of(2), "--at", url, "--hidden", "32",
                           *common)
            self.addCleanup(second.kill)
            for process, other in ((first, "n2"), (second, "n1")):
                code, _, err = finish(process)
                self.assertIn(code, (0, 7), err)
                words = f"cles-dsgd: {other}: its network: its shape is not that of this node's: 64 pixels, "
                self.assertEqual(err.count(words), 1, err)

    def test_a_ring_goes_on_without_a_killed_node(self):
        with Files(3) as files:
            processes = ring(self, files, 3, "--rounds", "400", "--evaluate", "20")
            read_line(processes[0])
            kill_process(processes[2])
            for each, name in zip(processes[:2], ("n1", "n2")):
                code, out, err = finish(each)
                self.assertIn(code, (0, 7), err)
                self.assertIn("cles-dsgd: n3 is lost: ", err)
                self.assertRegex(out, r"(?m)^round +400 +2 nodes ", name)


def kill_process(process):
    process.kill()
    process.communicate()


if __name__ == "__main__":
    unittest.main()
