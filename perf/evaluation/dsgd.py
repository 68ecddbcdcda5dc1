#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures distributed stochastic gradient descent as the paper's Table 2 does, row by row, and what delegating costs.

    dsgd.py [--programs build/release/apps] [--runs 30] [--threads N] [--epochs 100] [--quota 0.5] [--quick] [-o FILE]

Writes JSON. The rows take turns, run by run, so that whatever else the machine does falls on all of them. Overhead is
the manager's elapsed time less the longest shard's own, as its node measured it. The first host is this machine; the
second is a network namespace with one of its cores and a part of that core's time, where the system allows it: the
result says what it did not. Ends with 1 where results differ that must not.
"""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile

import dsgd_points
from clean_environment import clean_environment
from dsgd_hosts import Hosts, can_pin
from interval import summary
from provenance import command, date, machine
from result_file import write

PAPER_MSE = 0.0199
PAPER = {"local_one_near": (8150, 0.0198995), "local_one_far": (9360, 0.0198995), "local_all_near": (2180, 0.0198977),
         "local_all_far": (2500, 0.0198977), "near_asked_by_near": (2190, 0.0198977),
         "near_asked_by_far": (2290, 0.0198977), "both_asked_by_far": (2150, 0.0198978)}
PAPER_OVERHEAD_MS = 10
WANTED_OVERHEAD_MS = 2
SAME_MSE = 1e-9


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
    """(name, what it is, where the manager runs, its arguments)"""
    both = ["--at", urls["far"], "--nodes", "beside,far", "-k", str(2 * threads)]
    return [
        ("local_one_near", "1 thread, first host", hosts.near, ["--local", "1"]),
        ("local_one_far", "1 thread, second host", hosts.far, ["--local", "1"]),
        ("local_all_near", f"{threads} threads, first host", hosts.near, ["--local", str(threads)]),
        ("local_all_far", f"{threads} threads, second host", hosts.far, ["--local", str(threads)]),
        ("near_asked_by_near", f"{threads} on the first host, asked from there", hosts.near,
         ["--at", urls["near"], "--nodes", "near", "-k", str(threads)]),
        ("near_asked_by_far", f"{threads} on the first host, asked from the second", hosts.far,
         ["--at", urls["near"], "--nodes", "near", "-k", str(threads)]),
        ("both_asked_by_far", f"{threads} on each host, even, asked from the second", hosts.far, both),
        ("both_weighted", f"{threads} on each host, by speed, asked from the second", hosts.far, [*both, "--weighted"]),
    ]


def run_manager(programs, host, arguments, epochs):
    words = host.command(os.path.join(programs, "cles-dsgd"), "--json", "--epochs", str(epochs), *arguments)
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=600, check=False,
                          env=clean_environment())
    if done.returncode != 0:
        raise SystemExit(f"dsgd.py: {' '.join(arguments)} ended with {done.returncode}: {done.stderr}")
    return json.loads(done.stdout)


def measure(programs, hosts, threads, epochs, runs):
    folder = tempfile.mkdtemp(prefix="cles-dsgd-")
    daemons = []
    try:
        urls = {}
        # `beside`: the first host without the core of the second, for work on both.
        for name, host in (("near", hosts.near), ("beside", hosts.near.on(hosts.others)), ("far", hosts.far)):
            daemons.append(Daemon(programs, host, name, threads, list(urls.values())[:1], folder))
            urls[name] = daemons[-1].url
        rows = rows_of(hosts, urls, threads)
        reports = {row[0]: [] for row in rows}
        for turn in range(runs + 1):  # the first one warms up
            for name, _, host, arguments in rows[turn % len(rows):] + rows[:turn % len(rows)]:
                report = run_manager(programs, host, arguments, epochs)
                if turn > 0:
                    reports[name].append(report)
            print(f"\rdsgd: {turn} of {runs} rounds", end="", file=sys.stderr, flush=True)
        print(file=sys.stderr)
        return [row_result(name, meaning, reports[name]) for name, meaning, _, _ in rows]
    finally:
        for daemon in daemons:
            daemon.stop()
        shutil.rmtree(folder, ignore_errors=True)


def distinct(results):
    return [each for place, each in enumerate(results) if each not in results[:place]]


def row_result(name, meaning, reports):
    paper_ms, paper_mse = PAPER.get(name, (None, None))
    result = {"name": name, "meaning": meaning, "paper_ms": paper_ms, "paper_mse": paper_mse,
              "elapsed_ms": summary([r["times"]["elapsed_ms"] for r in reports]),
              "mse": [min(r["quality"]["mse"] for r in reports), max(r["quality"]["mse"] for r in reports)],
              "least_mse": reports[0]["quality"]["least_mse"], "wrong": reports[0]["quality"]["wrong"],
              "elapsed_all_ms": [r["times"]["elapsed_ms"] for r in reports],
              "classifiers": distinct([{**r["result"], "mse": r["quality"]["mse"]} for r in reports])}
    if not name.startswith("local"):
        overheads = [r["times"]["overhead_ms"] for r in reports]
        result["overhead_ms"], result["overhead_all_ms"] = summary(overheads), overheads
    if name == "both_weighted":
        result["trial_ms"] = summary([r["trial_ms"] for r in reports])
        result["points"] = [[s["what"]["count"] for s in r["shards"]] for r in reports]
    return result


def checks_of(rows, points):
    by_name = {row["name"]: row for row in rows}
    same = [by_name[name] for name in ("local_all_near", "local_all_far", "near_asked_by_near", "near_asked_by_far")]
    errors = {f"{mse:.6g}" for row in same for mse in row["mse"]}
    again = all(abs(dsgd_points.mean_squared_error(points, each) - each["mse"]) < SAME_MSE
                for row in rows for each in row["classifiers"])
    even, weighted = by_name["both_asked_by_far"]["elapsed_ms"], by_name["both_weighted"]["elapsed_ms"]
    return {"same_mse_to_6_digits": len(errors) == 1, "mse_found_again": again, "mse_at_most_paper": all(row["mse"][1] <= PAPER_MSE for row in rows),
            "overhead_ms": by_name["near_asked_by_near"]["overhead_ms"], "overhead_paper_ms": PAPER_OVERHEAD_MS,
            "overhead_at_most_2_ms": by_name["near_asked_by_near"]["overhead_ms"]["median"] <= WANTED_OVERHEAD_MS,
            "weighted_to_even": weighted["median"] / even["median"]}


def main():
    parser = argparse.ArgumentParser(description="Measures distributed stochastic gradient descent (the paper's Table 2).")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)), help="per host; default: all cores")
    parser.add_argument("--epochs", type=int, default=100)
    parser.add_argument("--quota", type=float, default=0.5, help="part of its core that the second host has")
    parser.add_argument("--quick", action="store_true", help="3 short runs: shows that it works, not how fast")
    parser.add_argument("-o", "--output", default="-")
    options = parser.parse_args()
    if options.quick:
        options.runs, options.epochs = 3, 10
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what it started is ended
    if not can_pin():
        raise SystemExit("dsgd.py: it requires taskset")
    before = machine()  # before anything runs
    with Hosts(options.quota) as hosts:
        rows = measure(options.programs, hosts, options.threads, options.epochs, options.runs)
        points = dsgd_points.made()
        averaged = next(row["classifiers"][0] for row in rows if row["name"] == "near_asked_by_near")
        result = {"what": "distributed stochastic gradient descent (section 4.2, Table 2)", "rows": rows,
                  "checks": checks_of(rows, points), "pictured": dsgd_points.pictured(points, averaged),
                  "hosts": hosts.described(), "threads": options.threads, "epochs": options.epochs,
                  "runs": options.runs, "quick": options.quick, "machine": before, "date": date(),
                  "command": command("perf/evaluation/dsgd.py")}
    write(result, options.output)
    return 0 if result["checks"]["same_mse_to_6_digits"] and result["checks"]["mse_found_again"] else 1


if __name__ == "__main__":
    sys.exit(main())
