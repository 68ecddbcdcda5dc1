#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures distributed stochastic gradient descent as the paper's Table 2 does, row by row, what delegating costs, and what
a second host gains, also by the size of the shards.

    dsgd.py [--programs build/release/apps] [--runs 30] [--threads 4] [--work 2300] [--epochs N] [--quota 0.5] [--quick]
            [-o FILE]

Writes JSON. Each host has as many threads as the paper's, and the work takes as long: so many epochs that all threads of the
first host take 2.3 s. The rows take turns, run by run, so that whatever else the machine does falls on all of them. The first
host is this machine; the second is a network namespace with one of its cores and a part of that core's time, where the system
allows it: the result says what it did not. Between them is a virtual cable; two rows are repeated over a link like WiFi, which
requires root. Ends with 1 where results differ that must not.
"""

import argparse
import contextlib
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile

import dsgd_figures
import dsgd_points
from clean_environment import clean_environment
from dsgd_hosts import Hosts, can_pin
from interval import summary
from linked_hosts import WIFI, LinkedHosts, why_not
from provenance import command, date, machine
from result_file import write

SAME_MSE = 1e-9
MOST_EPOCHS = 1_000_000
LEAST_STEPS = 50_000  # of a shard: with fewer, the classifier is still near its start
SHARDS_MS = (1, 3, 10, 30, 100, 300, 1000)  # sizes for the curve, below that of the rows
BY_WIFI = ("near_asked_by_far", "both_asked_by_far")  # the rows that are repeated
OF_SIZES = ("local_all_near", "near_asked_by_near", "near_reduced_asked_by_far", "both_asked_by_far", "both_resplit")


class Daemon:
    def __init__(self, programs, host, name, workers, seeds, folder):
        plugin = os.path.join(programs, "..", "plugins", "libcles-sgd.so")
        self.log = os.path.join(folder, name + ".log")
        config = os.path.join(folder, name + ".yaml")
        with open(config, "w", encoding="utf-8") as file:
            file.write(f"node: {name}\nlisten: [tcp://{host.address}:0]\ninsecure: true\nmulticast: off\n"
                       f"workers: {workers}\nplugins: [{os.path.abspath(plugin)}]\n"
                       + (f"seeds: [{', '.join(seeds)}]\n" if seeds else ""))
        with open(self.log, "w", encoding="utf-8") as log:
            self.process = subprocess.Popen(host.command(os.path.join(programs, "clesd"), "--config", config),
                                            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, text=True,
                                            env=clean_environment())
        found = re.search(r"listening on (tcp://\S+)", self.process.stdout.readline())
        if not found:
            self.stop()
            with open(self.log, encoding="utf-8") as log:
                raise SystemExit(f"dsgd.py: {name} did not start: {log.read()}")
        self.url = found[1]

    def stop(self):
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()


def rows_of(hosts, urls, threads):
    """{name: (what it is, where the manager runs, its arguments)}"""
    def asked(who, node, shards, *more):
        return who, ["--at", urls[node], "--nodes", f"near_reduced,{node}" if node == "far" else node, "-k", str(shards),
                     "--deadline", "600", *more]

    near_reduced = hosts.near.on(hosts.others)
    return {
        "local_one_near": ("1 thread, first host", hosts.near, ["--local", "1"]),
        "local_one_far": ("1 thread, second host", hosts.far, ["--local", "1"]),
        "local_all_near": (f"{threads} threads, first host", hosts.near, ["--local", str(threads)]),
        "local_all_far": (f"{threads} threads, second host", hosts.far, ["--local", str(threads)]),
        "local_all_near_reduced": (f"{threads} threads, first host less one core", near_reduced, ["--local", str(threads)]),
        "near_asked_by_near": (f"{threads} on the first host, asked from there", *asked(hosts.near, "near", threads)),
        "near_asked_by_far": (f"{threads} on the first host, asked from the second", *asked(hosts.far, "near", threads)),
        "near_reduced_asked_by_far": (f"{threads} on the first less one core, asked from the second",
                                      *asked(hosts.far, "near_reduced", threads)),
        "both_asked_by_far": (f"{threads} on each host, even", *asked(hosts.far, "far", 2 * threads)),
        "both_weighted": (f"{threads} on each host, by speed", *asked(hosts.far, "far", 2 * threads, "--weighted")),
        "both_resplit": (f"{threads} on each host, re-split", *asked(hosts.far, "far", 2 * threads, "--resplit")),
    }


def run_manager(programs, host, arguments, epochs):
    words = host.command(os.path.join(programs, "cles-dsgd"), "--json", "--epochs", str(epochs), *arguments)
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=900, check=False,
                          env=clean_environment())
    if done.returncode != 0:
        raise SystemExit(f"dsgd.py: {' '.join(arguments)} ended with {done.returncode}: {done.stderr}")
    return json.loads(done.stdout)


def epochs_for(programs, host, threads, work_ms):
    """So many that threads without CLES take this long, if no other work disturbs them."""
    epochs = 20
    while True:
        took = min(run_manager(programs, host, ["--local", str(threads)], epochs)["times"]["elapsed_ms"] for _ in range(3))
        wanted = min(MOST_EPOCHS, math.ceil(epochs * work_ms / took))
        if took >= work_ms / 2 or wanted <= epochs:
            return wanted
        epochs = wanted


def least_epochs(threads):
    """So many that even shards on both hosts have enough steps."""
    return math.ceil(LEAST_STEPS * 2 * threads / (2 * dsgd_points.PER_CLASS))


class Daemons:
    """Those that the rows need, on both hosts."""

    def __init__(self, programs, hosts, threads):
        self.folder = tempfile.mkdtemp(prefix="cles-dsgd-")
        self.daemons, self.urls = [], {}
        try:
            # `near_reduced`: the first host without the core of the second, for work on both.
            for name, host in (("near", hosts.near), ("near_reduced", hosts.near.on(hosts.others)), ("far", hosts.far)):
                self.daemons.append(Daemon(programs, host, name, threads, list(self.urls.values())[:1], self.folder))
                self.urls[name] = self.daemons[-1].url
        except BaseException:
            self.__exit__()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for daemon in self.daemons:
            daemon.stop()
        shutil.rmtree(self.folder, ignore_errors=True)


def rounds_of(programs, rows, epochs, runs, what):
    """{name: reports}, after a round that warms up. Each round begins with another row."""
    names = list(rows)
    reports = {name: [] for name in names}
    for turn in range(runs + 1):
        for name in names[turn % len(names):] + names[:turn % len(names)]:
            _, host, arguments = rows[name]
            report = run_manager(programs, host, arguments, epochs)
            if turn > 0:
                reports[name].append(report)
        print(f"\rdsgd: {what}, {turn} of {runs} rounds", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return reports


def size_result(epochs, reports):
    """One point of the curve: overhead and speed-up for shards of this size."""
    ms = {name: [each["times"]["elapsed_ms"] for each in found] for name, found in reports.items()}
    qualities = [each["quality"] for found in reports.values() for each in found]
    local, near, alone = ms["local_all_near"], ms["near_asked_by_near"], ms["near_reduced_asked_by_far"]
    return {"epochs": epochs, "mse_ratio": max(each["mse"] / each["least_mse"] for each in qualities),
            "work_ms": summary(local), "shard_ms": summary([each["times"]["longest_ms"] for each in reports["local_all_near"]]),
            "delegate_less_local_ms": summary([a - b for a, b in zip(near, local)]),
            "share": summary([(a - b) / b * 100 for a, b in zip(near, local)]),
            "strict_share": summary([each["times"]["overhead_ms"] / b * 100
                                     for each, b in zip(reports["near_asked_by_near"], local)]),
            "gain_even": summary([a / b for a, b in zip(alone, ms["both_asked_by_far"])]),
            "gain_resplit": summary([a / b for a, b in zip(alone, ms["both_resplit"])])}


@contextlib.contextmanager
def rows_by_wifi(programs, hosts, threads):
    """Rows as above; none where there can be no such link, which the hosts then say."""
    relay = os.path.join(programs, "..", "perf", "links", "cles_link_relay")
    reason = why_not() or ("" if os.access(relay, os.X_OK) else f"there is no {relay}")
    if reason:
        hosts.missing.append(f"a link like WiFi ({reason}): its rows are left out")
        yield {}
        return
    with LinkedHosts(relay, WIFI) as linked:
        pair = hosts.over(linked)
        with Daemons(programs, pair, threads) as daemons:
            yield {f"{name}_wifi": (f"{meaning}, over a link like WiFi", *more)
                   for name, (meaning, *more) in rows_of(pair, daemons.urls, threads).items() if name in BY_WIFI}


def measure(programs, hosts, threads, epochs, runs, sizes):
    """The results of the rows, and of each size, which is a number of epochs."""
    with Daemons(programs, hosts, threads) as daemons, rows_by_wifi(programs, hosts, threads) as by_wifi:
        rows = {**rows_of(hosts, daemons.urls, threads), **by_wifi}
        reports = rounds_of(programs, rows, epochs, runs, "Table 2")
        curve = [size_result(each, rounds_of(programs, {name: rows[name] for name in OF_SIZES}, each, max(2, runs // 2),
                                             f"size {place + 1} of {len(sizes)}")) for place, each in enumerate(sizes)]
    curve.append(size_result(epochs, {name: reports[name] for name in OF_SIZES}))
    return [row_result(name, rows[name][0], reports[name]) for name in rows], curve


def distinct(results):
    return [each for place, each in enumerate(results) if each not in results[:place]]


def row_result(name, meaning, reports):
    elapsed = [r["times"]["elapsed_ms"] for r in reports]
    result = {"name": name, "meaning": meaning, "paper_ms": dsgd_figures.PAPER_MS.get(name), "elapsed_ms": summary(elapsed),
              "elapsed_all_ms": elapsed, "mse": [end(r["quality"]["mse"] for r in reports) for end in (min, max)],
              "least_mse": reports[0]["quality"]["least_mse"], "wrong": reports[0]["quality"]["wrong"],
              "classifiers": distinct([{**r["result"], "mse": r["quality"]["mse"]} for r in reports])}
    if not name.startswith("local"):
        result["overhead_all_ms"] = [r["times"]["overhead_ms"] for r in reports]
    if name == "both_weighted":
        result["trial_all_ms"] = [r["trial_ms"] for r in reports]
        result["trial_shortest_all_ms"] = [r["trial_shortest_ms"] for r in reports]
    if name in ("both_weighted", "both_resplit"):
        result["points"] = [[[part["node"], part["points"]] for part in r["parts"]] for r in reports]
    return result


def checks_of(rows, curve, points):
    by_name = {row["name"]: row for row in rows}
    same = [by_name[name] for name in ("local_all_near", "local_all_far", "local_all_near_reduced", "near_asked_by_near",
                                       "near_asked_by_far", "near_asked_by_far_wifi", "near_reduced_asked_by_far")
            if name in by_name]
    errors = {f"{mse:.6g}" for row in same for mse in row["mse"]}
    again = all(abs(dsgd_points.mean_squared_error(points, each) - each["mse"]) < SAME_MSE
                for row in rows for each in row["classifiers"])
    good = all(each["mse_ratio"] <= dsgd_figures.WANTED_MSE_RATIO for each in curve)
    return {"same_mse_to_6_digits": len(errors) == 1, "mse_found_again": again, "sizes_near_least_mse": good}


def figures_of(rows, curve, checks, hosts, threads):
    return [*dsgd_figures.figures(rows, curve, hosts.described(), threads),
            dsgd_figures.yes_or_no("same_mse", "rows of the same shards have the same error, to 6 digits",
                                   checks["same_mse_to_6_digits"]),
            dsgd_figures.yes_or_no("mse_found_again", "each error is found again by a program that makes the data a second "
                                   "time, to 1e-9", checks["mse_found_again"]),
            dsgd_figures.yes_or_no("sizes_near_least_mse", "each size of the curve gives a classifier with at most "
                                   f"{dsgd_figures.WANTED_MSE_RATIO:g} times the least error", checks["sizes_near_least_mse"])]


def notes(hosts, threads, epochs):
    yield f"The work is {epochs} steps for each of {2 * dsgd_points.PER_CLASS} points, in all rows."
    cores = len(hosts.near.cores)
    yield (f"Each host runs {threads} threads, or as many workers; the first host has {cores} core{'s' if cores > 1 else ''}"
           + (", so that its threads take turns." if threads > cores else "."))
    part = f", and {hosts.quota:.0%} of its time in periods of {hosts.period_ms:g} ms" if hosts.quota else ""
    yield (f"The second host has one core{part}. " + ("In rows with both hosts, the first does not have that core."
                                                       if hosts.others != hosts.far.cores else
                                                       "There is no other one, so the first host shares it in all rows."))


def main():
    parser = argparse.ArgumentParser(description="Measures distributed stochastic gradient descent (the paper's Table 2).")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--threads", type=int, default=dsgd_figures.PAPER_THREADS, help="per host (4, as in the paper)")
    parser.add_argument("--work", type=float, default=2300, metavar="MS",
                        help="how long all threads of the first host take: the paper's take 2180 ms")
    parser.add_argument("--epochs", type=int, help="instead of as many as this takes")
    parser.add_argument("--quota", type=float, default=0.5, help="part of its core that the second host has")
    parser.add_argument("--quick", action="store_true", help="3 short runs: shows that it works, not how fast")
    parser.add_argument("-o", "--output", default="-")
    options = parser.parse_args()
    if options.quick:
        options.runs, options.epochs = 3, options.epochs or 10
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what it started is ended
    if not can_pin():
        raise SystemExit("dsgd.py: it requires taskset")
    before = machine()  # before anything runs
    with Hosts(options.quota) as hosts:
        epochs = options.epochs or epochs_for(options.programs, hosts.near, options.threads, options.work)
        sizes = [1, 3] if options.quick else [math.ceil(epochs * each / options.work) for each in SHARDS_MS]
        rows, curve = measure(options.programs, hosts, options.threads, epochs, options.runs,
                              sorted({each for each in sizes if least_epochs(options.threads) <= each < epochs}))
        points = dsgd_points.made()
        averaged = next(row["classifiers"][0] for row in rows if row["name"] == "near_asked_by_near")
        checks = checks_of(rows, curve, points)
        result = {"what": "distributed stochastic gradient descent (section 4.2, Table 2)",
                  "figures": figures_of(rows, curve, checks, hosts, options.threads), "rows": rows, "sizes": curve,
                  "checks": checks,
                  "pictured": dsgd_points.pictured(points, averaged), "hosts": hosts.described(),
                  "notes": list(notes(hosts, options.threads, epochs)), "threads": options.threads, "epochs": epochs, "runs": options.runs,
                  "quick": options.quick,
                  "machine": before, "date": date(), "command": command("perf/evaluation/dsgd.py")}
    write(result, options.output)
    return 0 if all(checks.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
