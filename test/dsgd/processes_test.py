#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Distributed stochastic gradient descent as its users run it: daemons, and the manager as a separate process. The
result does not depend on the workers; if a process is killed, the outcome of each shard is reported."""

import functools
import json
import os
import signal
import subprocess
import time
import unittest

from daemon import DEFAULTS, Daemon, clean_environment, wait_until_running
from support import PATIENCE, finish, read_line, wait_until

DSGD = os.environ["DSGD"]
MINIMAL = os.environ["DSGD_MINIMAL"]
PLUGIN = os.environ["SGD_PLUGIN"]
HANGING = os.environ["HANGING_PLUGIN"]  # its workers answer only when they are withdrawn
LONG, ENDLESS = "1000", "1000000"  # epochs: half a second or more for a shard, and longer than any test waits


def node(name, *seeds, plugin=f"plugins: [{PLUGIN}]\n", workers=2):
    known = f"seeds: [{', '.join(seeds)}]\n" if seeds else ""
    base = DEFAULTS.replace("sat1", name).replace("level: debug", "level: info")
    return Daemon("drain: 500ms\n" + known + plugin, base=base.replace("workers: 2", f"workers: {workers}"))


def start(*arguments):
    return subprocess.Popen([DSGD, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE, text=True, env=clean_environment())


def run(*arguments):
    """Exit code, stdout, stderr."""
    return finish(start(*arguments))


@functools.lru_cache(maxsize=None)
def trained_here(epochs):
    """The result, computed by the manager itself."""
    code, out, err = run("--local", "4", "-e", epochs, "--json")
    if code != 0:
        raise AssertionError(err)
    return json.loads(out)["result"]


def live_at(daemon):
    return {peer["node"] for peer in json.loads(daemon.ask("PULL self:cles/peers"))["peers"] if peer["state"] == "live"}


class Cluster:
    """sat1 and sat2, which know each other."""

    def __enter__(self):
        self.sat1 = node("sat1").__enter__()
        try:
            self.sat2 = node("sat2", self.sat1.url).__enter__()
            wait_until(lambda: live_at(self.sat1) == {"sat2"} and live_at(self.sat2) == {"sat1"}, "both know each other")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for daemon in (self.sat1, getattr(self, "sat2", None)):
            if daemon:
                daemon.__exit__()


def kill(daemon):
    daemon.send_signal(signal.SIGKILL)
    daemon.process.wait()


class Manager(unittest.TestCase):
    def check(self, arguments, code=0):
        """The object that it prints."""
        ended, out, err = run(*arguments, "--json")
        self.assertEqual(ended, code, err)
        return json.loads(out), err

    def fates(self, report):
        return [shard["fate"] for shard in report["shards"]]

    def test_whoever_computes_the_result_is_the_same(self):
        here, _ = self.check(["--local", "4", "-e", "20"])
        self.assertLess(here["quality"]["mse"], here["quality"]["least_mse"] * 1.02)
        self.assertEqual(self.fates(here), ["done"] * 4)
        with Cluster() as cluster:
            for more in ([], ["--nodes", "sat1"], ["--nodes", "sat2,sat1"]):
                there, err = self.check(["--at", cluster.sat1.url, "-e", "20", *more])
                self.assertEqual(there["result"], here["result"], more)
                self.assertEqual(there["quality"], here["quality"])
                self.assertEqual(self.fates(there), ["done"] * 4)
                self.assertEqual(err, "")
                times = there["times"]
                self.assertGreater(times["overhead_ms"], 0)
                self.assertAlmostEqual(times["elapsed_ms"], times["longest_ms"] + times["overhead_ms"], 6)
                self.assertEqual(times["longest_ms"], max(part["ms"] for part in there["parts"]))

    def test_named_nodes_have_their_turns(self):
        with Cluster() as cluster:
            report, _ = self.check(["--at", cluster.sat2.url, "-e", "5", "-k", "5", "-n", "sat2,sat1"])
            self.assertEqual([part["node"] for part in report["parts"]], ["sat2", "sat1", "sat2", "sat1", "sat2"])

    def test_by_speed_all_points_are_trained_on_once(self):
        with Cluster() as cluster:
            report, _ = self.check(["--at", cluster.sat1.url, "-e", "30", "--weighted"])
        self.assertEqual(self.fates(report), ["done"] * 4)
        self.assertEqual({part["node"] for part in report["parts"]}, {"sat1", "sat2"})
        self.assertGreater(report["trial_ms"], 0)
        next_point = 0
        for shard in report["shards"]:
            self.assertEqual(shard["what"]["first"], next_point)
            next_point += shard["what"]["count"]
        self.assertEqual(next_point, 200_000)
        self.assertLess(report["quality"]["mse"], report["quality"]["least_mse"] * 1.02)

    def test_a_trial_takes_long_enough_unless_the_work_does_not(self):
        alone = min(self.check(["--local", "1", "-e", "50"])[0]["times"]["elapsed_ms"] for _ in range(3))
        epochs = str(round(50 * 4000 / alone))  # four seconds in this build: a quarter is three times what a trial takes
        with node("sat1") as daemon:
            report, _ = self.check(["--at", daemon.url, "-n", "sat1", "-k", "1", "-e", epochs, "--weighted", "--deadline",
                                    "600"])
            self.assertGreaterEqual(report["trial_shortest_ms"], 300)
            times = report["times"]
            self.assertGreater(times["elapsed_ms"], report["trial_ms"] + times["longest_ms"])
            self.assertGreater(times["overhead_ms"], report["trial_ms"])
            code, out, err = run("--at", daemon.url, "-n", "sat1", "-e", "20", "--weighted")
        self.assertEqual(code, 0, err)
        self.assertRegex(err, r"(?m)^cles-dsgd: trial, [1-9]\d % of 200000 points$")
        self.assertRegex(err, r"(?m)^cles-dsgd: [1-9]\d % of 200000 points$")
        self.assertRegex(out, r"(?m)^trial +\d+\.\d{3} ms, contained in the overhead$")
        with node("sat1", plugin=f"plugins: [{{path: {PLUGIN}, config: {{per_class: 1000}}}}]\n") as daemon:
            # One epoch takes less than a millisecond: the first attempt is too short, the second is limited to five.
            report, _ = self.check(["--at", daemon.url, "-n", "sat1", "-k", "1", "-e", "20", "--weighted"])
            self.assertEqual(report["trial_attempts"], 2)
            self.assertLess(report["trial_shortest_ms"], 300)

    def test_what_is_left_is_split_again(self):
        with Cluster() as cluster:
            report, _ = self.check(["--at", cluster.sat1.url, "-e", LONG, "--resplit"])
            code, out, err = run("--at", cluster.sat1.url, "-e", "30", "--resplit")
        self.assertEqual(code, 0, err)
        self.assertRegex(out, r"(?m)^elapsed +\d+\.\d{3} ms: the longest slot ")
        self.assertGreater(len(report["shards"]), 4)
        self.assertEqual(set(self.fates(report)), {"done"})
        self.assertEqual({part["node"] for part in report["parts"]}, {"sat1", "sat2"})
        self.assertEqual([shard["what"]["seed"] for shard in report["shards"]],
                         list(range(1, len(report["shards"]) + 1)))
        next_point = 0
        for shard, part in zip(report["shards"], report["parts"]):
            self.assertEqual(shard["what"]["first"], next_point)
            self.assertEqual(part["points"], shard["what"]["count"])
            self.assertEqual(part["node"], ["sat1", "sat2"][shard["slot"] % 2])
            next_point += shard["what"]["count"]
        self.assertEqual(next_point, 200_000)
        self.assertLess(report["quality"]["mse"], report["quality"]["least_mse"] * 1.01)

    def test_it_goes_on_splitting_without_a_lost_node(self):
        with Cluster() as cluster:
            manager = start("--at", cluster.sat1.url, "-e", "3000", "--resplit", "--json")
            wait_until_running(cluster.sat2, 2)
            kill(cluster.sat2)
            code, out, err = finish(manager)
        self.assertEqual(code, 0, err)
        report = json.loads(out)
        self.assertEqual(set(self.fates(report)), {"done", "lost"})
        self.assertEqual(sum(part["points"] for part in report["parts"]), 200_000)
        for shard, part in zip(report["shards"], report["parts"]):
            self.assertEqual((shard["fate"] == "lost"), bool(shard["trouble"]))
            self.assertEqual(part["points"], shard["what"]["count"] if shard["fate"] == "done" else 0)
            self.assertEqual(shard["target"], "sat2" if shard["fate"] == "lost" else part["node"])
        self.assertRegex(err, r"(?m)^cles-dsgd: shard \d+: sat2: unavailable: .*; its points are divided again$")
        self.assertEqual(report["shards"][-1]["target"], "sat1")
        self.assertLess(report["quality"]["mse"], report["quality"]["least_mse"] * 1.01)

    def test_splitting_again_costs_no_quality(self):
        with Cluster() as cluster:
            for more in (["-e", "1"], ["-e", "2"], ["-e", "100", "-k", "64"], ["-e", "100", "-k", "1024"]):
                report, _ = self.check(["--at", cluster.sat1.url, "--resplit", *more])
                self.assertEqual(sum(part["points"] for part in report["parts"]), 200_000)
                self.assertLess(report["quality"]["mse"], report["quality"]["least_mse"] * 1.01, more)

    def test_by_default_all_nodes_have_shards(self):
        with node("sat1") as first:
            others = []
            try:
                for i in range(2, 6):
                    others.append(node(f"sat{i}", first.url).__enter__())
                wait_until(lambda: len(live_at(first)) == 4, "it knows the others")
                report, err = self.check(["--at", first.url, "-e", "4", "--weighted"])
                self.assertEqual(err, "")
                self.assertEqual([shard["target"] for shard in report["shards"]], [f"sat{i}" for i in range(1, 6)])
                for more in (["--weighted"], ["--nodes", "sat1,sat2,sat3,sat4"]):
                    _, err = self.check(["--at", first.url, "-e", "4", "-k", "3", *more])
                    self.assertRegex(err, r"^cles-dsgd: [12] nodes have nothing to do: there are only 3 shards\n$")
            finally:
                for other in others:
                    other.__exit__()

    def test_the_minimal_manager_gives_the_same_result(self):
        with Cluster() as cluster:
            done = subprocess.run([MINIMAL, cluster.sat1.url, "4", "20", "sat1", "sat2"], capture_output=True, text=True,
                                  check=False, env=clean_environment(), timeout=PATIENCE)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(json.loads(done.stdout), trained_here("20"))
            done = subprocess.run([MINIMAL, cluster.sat1.url, "4", "20", "sat9"], capture_output=True, text=True,
                                  check=False, env=clean_environment(), timeout=PATIENCE)
            self.assertEqual((done.returncode, done.stdout), (1, ""))
            self.assertIn("sat9", done.stderr)
            for shards, epochs in (("0", "1"), ("1025", "1"), ("abc", "1"), ("-1", "1"), ("4x", "1"), ("4", "0"),
                                   ("4", "1000001")):
                done = subprocess.run([MINIMAL, cluster.sat1.url, shards, epochs, "sat1"], capture_output=True, text=True,
                                      check=False, env=clean_environment(), timeout=PATIENCE)
                self.assertEqual((done.returncode, done.stdout), (2, ""))
                self.assertRegex(done.stderr, "^usage: ")
            manager = subprocess.Popen([MINIMAL, cluster.sat1.url, "2", ENDLESS, "sat2"], stdout=subprocess.PIPE,
                                       stderr=subprocess.PIPE, text=True, env=clean_environment())
            wait_until_running(cluster.sat2, 2)
            kill(cluster.sat2)
            code, out, err = finish(manager)
            self.assertEqual((code, out), (1, ""))
            self.assertRegex(err, "^cles-dsgd-minimal: unavailable: ")

    def test_for_people_it_prints_a_table_and_its_progress(self):
        with node("sat1") as daemon:
            code, out, err = run("--at", daemon.url, "-k", "2", "-e", "50")
        self.assertEqual(code, 0)
        self.assertRegex(out, r"(?m)^done +100000 points +\d+\.\d{3} ms  sat1\ndone +100000 points")
        self.assertRegex(out, r"(?m)^elapsed +\d+\.\d{3} ms: the longest shard \d+\.\d{3}, overhead \d+\.\d{3}$")
        self.assertRegex(out, r"(?m)^mse +0\.01\d{5}; best possible 0\.01\d{5}; 0\.0\d{3} % of the points")
        self.assertRegex(err, r"(?m)^cles-dsgd: [1-9]\d % of 200000 points$")

    # -- processes that are killed -------------------------------------------------------------------------------------

    def test_a_lost_nodes_shards_are_delegated_again(self):
        with Cluster() as cluster:
            manager = start("--at", cluster.sat1.url, "--nodes", "sat1,sat2", "-e", LONG, "--json")
            wait_until_running(cluster.sat2, 2)
            kill(cluster.sat2)
            code, out, err = finish(manager)
        self.assertEqual(code, 0, err)
        report = json.loads(out)
        self.assertEqual(self.fates(report), ["done"] * 4)
        self.assertEqual([part["node"] for part in report["parts"]], ["sat1"] * 4)
        for i in (1, 3):
            self.assertRegex(report["shards"][i]["trouble"][0], "^sat2: unavailable: ")
            self.assertRegex(err, rf"(?m)^cles-dsgd: shard {i + 1}: sat2: unavailable: .*; retrying at sat1$")
        self.assertEqual(report["shards"][0]["trouble"], [])
        self.assertEqual(report["result"], trained_here(LONG))

    def test_any_goes_on_without_the_node_whose_address_it_was_given(self):
        with Cluster() as cluster:
            manager = start("--at", cluster.sat1.url, "-e", LONG, "--json")
            wait_until(lambda: json.loads(cluster.sat1.ask("PULL self:cles/metrics"))["pool"]["running"] > 0, "it began")
            kill(cluster.sat1)
            code, out, err = finish(manager)
        self.assertEqual(code, 0, err)
        report = json.loads(out)
        self.assertEqual(self.fates(report), ["done"] * 4)
        self.assertEqual({part["node"] for part in report["parts"]}, {"sat2"})
        self.assertEqual(report["result"], trained_here(LONG))

    def test_where_nobody_is_left_each_fate_is_told(self):
        for more in ([], ["--resplit"]):
            with node("sat1") as daemon:
                manager = start("--at", daemon.url, "--nodes", "sat1", "-e", ENDLESS, "--json", *more)
                wait_until_running(daemon, 2)
                kill(daemon)
                code, out, err = finish(manager)
            self.assertEqual(code, 5, err)
            report = json.loads(out)
            self.assertEqual(sorted(self.fates(report)), ["failed", "withdrawn", "withdrawn", "withdrawn"])
            self.assertRegex(report["error"], r"^shard \d: sat1: unavailable: ")
            self.assertIn(report["error"], err)

    def test_daemons_go_on_without_a_killed_manager(self):
        with Cluster() as cluster:
            manager = start("--at", cluster.sat1.url, "--nodes", "sat1,sat2", "-e", ENDLESS, "--json")
            wait_until_running(cluster.sat1, 2)
            wait_until_running(cluster.sat2, 2)
            manager.kill()
            manager.communicate(timeout=PATIENCE)
            wait_until_running(cluster.sat1, 0)  # their results are no longer needed
            wait_until_running(cluster.sat2, 0)
            report, _ = self.check(["--at", cluster.sat1.url, "-e", "5"])
            self.assertEqual(self.fates(report), ["done"] * 4)
            self.assertEqual([daemon.stop()[0] for daemon in (cluster.sat1, cluster.sat2)], [0, 0])

    def test_a_shard_past_its_deadline_goes_elsewhere_or_fails(self):
        with node("sat1") as daemon:
            report, _ = self.check(["--at", daemon.url, "--nodes", "sat1", "-k", "1", "-e", ENDLESS, "--deadline", "1"], 4)
            self.assertEqual(self.fates(report), ["failed"])
            wait_until_running(daemon, 0)

    # -- nodes that hang, and nodes that join --------------------------------------------------------------------------

    def test_a_late_shard_goes_to_another_node_as_well(self):
        with node("sat1") as first, node("sat2", first.url, plugin=f"plugins: [{HANGING}]\n") as second:
            wait_until(lambda: live_at(first) == {"sat2"} and live_at(second) == {"sat1"}, "both know each other")
            for more in (["--nodes", "sat1,sat2"], []):
                report, err = self.check(["--at", first.url, "-e", "30", "--deadline", "3600", *more])
                self.assertEqual(self.fates(report), ["done"] * 4)
                self.assertEqual({part["node"] for part in report["parts"]}, {"sat1"})
                self.assertEqual(report["result"], trained_here("30"))
                late = [i for i, shard in enumerate(report["shards"]) if shard["also"]]
                if more:  # otherwise, sat1 may have had a free worker whenever a shard was sent
                    self.assertEqual(late, [1, 3])
                for i in late:
                    self.assertRegex(err, rf"(?m)^cles-dsgd: shard {i + 1} is late: sat[12] gets it as well$")
            wait_until_running(second, 0)  # its shards were withdrawn

    def test_splitting_goes_on_without_a_node_that_hangs(self):
        with node("sat1") as first, node("sat2", first.url, plugin=f"plugins: [{HANGING}]\n") as second:
            wait_until(lambda: live_at(first) == {"sat2"} and live_at(second) == {"sat1"}, "both know each other")
            report, _ = self.check(["--at", first.url, "-e", "30", "--deadline", "3600", "--resplit"])
        self.assertEqual(set(self.fates(report)), {"done"})
        self.assertEqual({part["node"] for part in report["parts"]}, {"sat1"})
        self.assertEqual(sum(part["points"] for part in report["parts"]), 200_000)

    def test_a_node_that_joins_gets_shards(self):
        for more in (["-k", "70"], ["--resplit", "-k", "2"]):
            with node("sat1", workers=1) as first:
                manager = start("--at", first.url, "-e", ENDLESS, "--json", *more)
                wait_until_running(first, 1)
                with node("sat2", first.url) as second:
                    self.assertEqual(read_line(manager, manager.stderr), "cles-dsgd: sat2 takes part from now on\n")
                    wait_until_running(second, 2)
                    manager.kill()
                    manager.communicate(timeout=PATIENCE)

    def test_a_result_that_is_not_good_is_told(self):
        for arguments, words in ((["--local", "4", "-e", "1", "--rate", "0.00001"], "times the best possible. "),
                                 (["--local", "1024", "-e", "1"], "times the best possible, and a constant does better. ")):
            report, err = self.check(arguments, 7)
            self.assertGreater(report["quality"]["mse"], report["quality"]["least_mse"] * 1.01)
            self.assertIn(report["shortcoming"], err)
            self.assertIn(words, err)
            code, out, again = run(*arguments)
            self.assertEqual((code, again), (7, err))
            self.assertRegex(out, r"(?m)^mse ")
        with node("sat1") as daemon:
            self.check(["--at", daemon.url, "-k", "1024", "-e", "1"], 7)

    # -- what is missing -------------------------------------------------------------------------------------------------

    def test_no_node_is_there(self):
        begun = time.monotonic()
        code, out, err = run("--at", "tcp://127.0.0.1:1")
        self.assertEqual((code, out), (3, ""))
        self.assertLess(time.monotonic() - begun, 5)  # the address refuses, so nothing is waited for
        self.assertEqual(err, "cles-dsgd: no node answers at the given address (--at): is clesd running there?\n")

    def test_a_node_that_does_not_answer_does_not_take_part(self):
        with Cluster() as cluster:
            cluster.sat2.send_signal(signal.SIGSTOP)
            try:
                report, err = self.check(["--at", cluster.sat1.url, "-e", "5", "--resplit"])
                self.assertEqual({part["node"] for part in report["parts"]}, {"sat1"})
                self.assertRegex(err, "(?m)^cles-dsgd: sat2 does not take part: ")
            finally:
                cluster.sat2.send_signal(signal.SIGCONT)

    def test_no_node_has_the_plugin(self):
        with node("sat1", plugin="") as daemon:
            code, out, err = run("--at", daemon.url)
        self.assertEqual((code, out), (3, ""))
        self.assertRegex(err, "^cles-dsgd: .*: is libcles-sgd.so among the plugins of a node\\?\n$")

    def test_a_named_node_is_not_there(self):
        with node("sat1") as daemon:
            code, out, err = run("--at", daemon.url, "--nodes", "sat1,sat9")
        self.assertEqual((code, out), (3, ""))
        self.assertEqual(err, "cles-dsgd: 'sat9' does not offer 'sgd': see cles ls --tasks\n")

    def test_a_node_has_other_data(self):
        with node("sat1") as first:
            with node("sat2", first.url, plugin=f"plugins: [{{path: {PLUGIN}, config: {{seed: 2}}}}]\n") as second:
                wait_until(lambda: live_at(first) == {"sat2"} and live_at(second) == {"sat1"}, "both know each other")
                for more in ([], ["--resplit"], ["--nodes", "sat1,sat2"]):
                    code, out, err = run("--at", first.url, "-k", "2", *more)
                    self.assertEqual((code, out), (5, ""))
                    self.assertIn("'sat1' and 'sat2' have different data: 100000 points per class, 7 apart, from seed 1, and "
                                  "100000 points per class, 7 apart, from seed 2.", err)
                for name in ("sat1", "sat2"):
                    report, _ = self.check(["--at", first.url, "--nodes", name, "-e", "5"])
                    self.assertEqual({part["node"] for part in report["parts"]}, {name})
                    self.assertEqual(self.fates(report), ["done"] * 4)
                # Two of the four shards are refused; the minimal manager reports the first.
                done = subprocess.run([MINIMAL, first.url, "4", "20", "sat1", "sat2"], capture_output=True, text=True,
                                      check=False, env=clean_environment(), timeout=PATIENCE)
                self.assertEqual((done.returncode, done.stdout), (1, ""))
                self.assertRegex(done.stderr, "^cles-dsgd-minimal: bad_request: .*this node has other data")

    def test_more_shards_than_points(self):
        with node("sat1", plugin=f"plugins: [{{path: {PLUGIN}, config: {{per_class: 1}}}}]\n") as daemon:
            for more in ([], ["--nodes", "sat1"], ["--weighted"]):
                code, out, err = run("--at", daemon.url, "-k", "3", *more)
                self.assertEqual((code, out), (5, ""))
                self.assertEqual(err, "cles-dsgd: 3 shards of 2 points: each takes at least one\n")
            report, _ = self.check(["--at", daemon.url, "-k", "2"], 7)  # two points do not make a good classifier
            self.assertEqual(self.fates(report), ["done"] * 2)
            done = subprocess.run([MINIMAL, daemon.url, "3", "1", "sat1"], capture_output=True, text=True, check=False,
                                  env=clean_environment(), timeout=PATIENCE)
            self.assertEqual((done.returncode, done.stderr),
                             (1, "cles-dsgd-minimal: 3 shards of 2 points: each takes at least one\n"))

    def test_a_descent_that_diverges(self):
        code, out, err = run("--local", "1", "--rate", "1")
        self.assertEqual((code, out, err), (5, "", "cles-dsgd: it does not converge: the rate is too large\n"))

    def test_wrong_usage(self):
        for arguments in (["--shards", "0"], ["--shards", "x"], ["--rate", "-1"], ["--rate", "nan"], ["--seed", "-1"], ["--nonsense"], ["--weighted", "--resplit"],
                          ["--at", "nonsense"], ["--local", "2", "--weighted"], ["--local", "2", "--resplit"],
                          ["--local", "2", "-k", "2"], ["--local", "2", "--nodes", "a"], ["--local", "2", "--deadline", "5"],
                          ["--local", "2", "--at", "tcp://127.0.0.1:1"]):
            code, out, err = run(*arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertNotEqual(err, "")


if __name__ == "__main__":
    unittest.main()
