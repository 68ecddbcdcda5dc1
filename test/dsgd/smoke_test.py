#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""All code of distributed stochastic gradient descent as processes, each part once and for as short as possible. The builds
with sanitizers run this instead of processes_test.py, which asserts more."""

import json
import signal
import subprocess
import unittest

from daemon import clean_environment, wait_until_running
from digits_test import Files, ring
from processes_test import ENDLESS, MINIMAL, PLUGIN, Cluster, kill, live_at, node, run, start
from support import PATIENCE, finish, read_line, wait_until


def minimal(*arguments):
    """Exit code, stdout, stderr."""
    done = subprocess.run([MINIMAL, *arguments], capture_output=True, text=True, check=False, env=clean_environment(),
                          timeout=PATIENCE)
    return done.returncode, done.stdout, done.stderr


class Smoke(unittest.TestCase):
    def told(self, *arguments, code=0):
        """The object that the manager prints, and its stderr."""
        ended, out, err = run(*arguments, "--json")
        self.assertEqual(ended, code, err)
        return json.loads(out), err

    def fates(self, report):
        return [shard["fate"] for shard in report["shards"]]

    def check_result(self, report, fates):
        self.assertEqual(self.fates(report), fates)
        self.assertEqual(sum(part["points"] for part in report["parts"]), 200_000)
        self.assertLess(report["quality"]["mse"], report["quality"]["least_mse"] * 1.05)

    def read_until(self, manager, words):
        said = ""
        while words not in said:
            line = read_line(manager, manager.stderr)
            self.assertNotEqual(line, "", f"it did not say {words!r}, but {said!r}")
            said += line

    def test_without_nodes(self):
        here, _ = self.told("--local", "4", "-e", "5")
        self.check_result(here, ["done"] * 4)
        self.assertEqual(run("--local", "1", "--rate", "1"),
                         (5, "", "cles-dsgd: it does not converge: the rate is too large\n"))
        self.assertEqual(run("--at", "tcp://127.0.0.1:1"),
                         (3, "", "cles-dsgd: no node answers at the given address (--at): is clesd running there?\n"))
        for arguments in (["--rate", "nan"], ["--at", "nonsense"]):
            code, out, err = run(*arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertNotEqual(err, "")
        code, out, err = minimal("tcp://127.0.0.1:1", "0", "1", "sat1")
        self.assertEqual((code, out), (2, ""))
        self.assertRegex(err, "^usage: ")

    def test_without_the_plugin(self):
        with node("sat1", plugin="") as daemon:
            code, out, err = run("--at", daemon.url)
        self.assertEqual((code, out), (3, ""))
        self.assertRegex(err, "^cles-dsgd: .*: is libcles-sgd.so among the plugins of a node\\?\n$")

    def check_shares(self, at):
        """Each way to divide the data."""
        named = ("--at", at, "-n", "sat1,sat2")
        report, err = self.told(*named, "-e", "5")
        self.check_result(report, ["done"] * 4)
        self.assertEqual(([part["node"] for part in report["parts"]], err), (["sat1", "sat2"] * 2, ""))
        anywhere, err = self.told("--at", at, "-e", "5")
        self.assertEqual((anywhere["result"], self.fates(anywhere), err), (report["result"], ["done"] * 4, ""))
        code, out, err = minimal(at, "4", "5", "sat1", "sat2")
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(json.loads(out), report["result"])

        report, err = self.told(*named, "-e", "1", "--resplit", "-k", "8")
        self.check_result(report, ["done"] * len(report["shards"]))
        self.assertRegex(err, "^cles-dsgd: only 4 of 8 slots have work: ")
        report, _ = self.told(*named, "-e", "100", "--resplit")
        self.check_result(report, ["done"] * len(report["shards"]))
        self.assertGreater(len(report["shards"]), 4)

        code, out, err = run(*named, "-e", "8", "-k", "1", "--weighted")
        self.assertEqual(code, 0, err)
        self.assertIn("cles-dsgd: 1 nodes have nothing to do: there are only 1 shards\n", err)
        self.assertRegex(err, r"(?m)^cles-dsgd: trial, [1-9]\d % of 200000 points$")
        self.assertRegex(err, r"(?m)^cles-dsgd: [1-9]\d % of 200000 points$")
        self.assertRegex(out, r"(?m)^done +200000 points +\d+\.\d{3} ms  sat1$")
        self.assertRegex(out, r"(?m)^elapsed +\d+\.\d{3} ms: the longest shard \d+\.\d{3}, overhead \d+\.\d{3}$")
        self.assertRegex(out, r"(?m)^trial +\d+\.\d{3} ms, contained in the overhead$")
        self.assertRegex(out, r"(?m)^mse +0\.01\d{5}; best possible 0\.01\d{5}; 0\.0\d{3} % of the points")

    def check_data(self, at):
        """Nodes that have other data, or none."""
        code, out, err = run("--at", at, "-n", "sat1,sat3")
        self.assertEqual((code, out), (5, ""))
        self.assertIn("'sat1' and 'sat3' have different data: 100000 points per class, 7 apart, from seed 1, and 1 points per "
                      "class, 7 apart, from seed 1.", err)
        code, out, err = minimal(at, "4", "5", "sat1", "sat3")
        self.assertEqual((code, out), (1, ""))
        self.assertRegex(err, "^cles-dsgd-minimal: bad_request: .*this node has other data")
        self.assertEqual(run("--at", at, "-n", "sat1,sat9"),
                         (3, "", "cles-dsgd: 'sat9' does not offer 'sgd': see cles ls --tasks\n"))
        self.assertEqual(run("--at", at, "-n", "sat3", "-k", "3"),
                         (5, "", "cles-dsgd: 3 shards of 2 points: each takes at least one\n"))

    def test_nodes(self):
        with Cluster() as cluster:
            at = cluster.sat1.url
            self.check_shares(at)

            # Killed: a node, whose shards another one takes; then the manager, whose shards nobody needs.
            manager = start("--at", at, "-n", "sat1,sat2", "-e", ENDLESS)
            wait_until_running(cluster.sat2, 2)
            kill(cluster.sat2)
            self.read_until(manager, "; retrying at sat1\n")
            manager.kill()
            manager.communicate(timeout=PATIENCE)
            wait_until_running(cluster.sat1, 0)

            cluster.sat2.__exit__()
            cluster.sat2 = node("sat2", at).__enter__()
            other = f"plugins: [{{path: {PLUGIN}, config: {{per_class: 1}}}}]\n"
            with node("sat3", at, plugin=other) as third:
                for daemon in (cluster.sat2, third):
                    wait_until(lambda at=daemon: "sat1" in live_at(at), "it knows the first node")
                self.check_data(at)
                self.check_lost(cluster, third)

    def test_rounds_and_neighbours(self):
        with Files(2) as files:
            with node("sat1", plugin=files.plugin(1)) as first, node("sat2", first.url, plugin=files.plugin(2)) as second:
                for daemon in (first, second):
                    wait_until(lambda at=daemon: len(live_at(at)) == 1, "they know each other")
                report, err = self.told("rounds", "--at", first.url, "--test", files.test, "--rounds", "3", code=7)
                self.assertEqual([each["nodes"] for each in report["course"]], [["sat1", "sat2"]] * 3)
                self.assertIn("it is not known whether the training has converged", err)
                manager = start("rounds", "--at", first.url, "--test", files.test, "--rounds", "100000")
                read_line(manager)
                kill(second)
                self.read_until(manager, "; the others go on\n")
                kill(first)
                self.assertEqual(finish(manager)[0], 5)
            here, _ = self.told("rounds", "--local", f"{files.of(1)},{files.of(2)}", "--test", files.test, "--rounds", "6",
                                "--evaluate", "0", code=7)
            self.assertEqual(here["images"], 800 * 6)
            for process in ring(self, files, 2, "--rounds", "6"):
                code, out, err = finish(process)
                self.assertIn(code, (0, 7), err)
                self.assertRegex(out, r"(?m)^round +6 +2 nodes ")

    def check_lost(self, cluster, third):
        """One after the other is killed, until nobody is left."""
        third.send_signal(signal.SIGSTOP)
        manager = start("--at", cluster.sat1.url, "-n", "sat1,sat2", "-e", ENDLESS, "--resplit", "--json")
        self.read_until(manager, "cles-dsgd: sat3 does not take part: ")
        wait_until_running(cluster.sat2, 2)
        kill(cluster.sat2)
        self.read_until(manager, "; its points are divided again\n")
        kill(cluster.sat1)
        code, out, err = finish(manager)
        self.assertEqual(code, 5, err)
        report = json.loads(out)
        self.assertLessEqual({"lost", "failed", "withdrawn"}, set(self.fates(report)))
        self.assertRegex(report["error"], r"^shard \d+: sat1: unavailable: ")
        self.assertIn(report["error"], err)
        third.send_signal(signal.SIGCONT)
        self.assertEqual(third.stop()[0], 0)


if __name__ == "__main__":
    unittest.main()
