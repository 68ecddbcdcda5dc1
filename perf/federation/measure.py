#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures what joining pools through NATS costs, with a nats-server that this starts, and prints each figure with its target:
requests through two bridges, plain and sealed, against two bare programs of libnats, publications for each update, faults, and
many pools.

    measure.py FOLDER [FAULTS [SECONDS]]        FOLDER contains cles_federation_cost and the others; 50 faults in 80 s
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import faults
from measured_server import MeasuredServer
from nats_server import MISSING, PROGRAM

IDLE = 10.0  # seconds, for which traffic is counted


class Report:
    def __init__(self):
        self.failed = False

    def add(self, what, value, target, good):
        self.failed |= not good
        print(f"{'ok  ' if good else 'MISS'} {what}: {value} (target: {target})", flush=True)


def make_fleet(cles, fleet, bridges):
    """The keys of bridges, each in a folder of its own, which may forward for everybody."""
    def run(*words):
        subprocess.run([cles, *words], capture_output=True, check=True)

    run("fleet", "init", fleet, "--with", ",".join(bridges))
    for name in bridges:
        run("fleet", "rights", name, "--forwards", "*", "--keys", fleet)
    for name in bridges:
        run("keys", "join", fleet / "roster", "--keys", fleet / name)
    return fleet


def measure_cost(folder, report):
    with MeasuredServer() as server, tempfile.TemporaryDirectory() as place:
        fleet = make_fleet(folder / "../../apps/cles", Path(place) / "fleet", ("gate", "hub"))
        done = subprocess.run([folder / "cles_federation_cost", server.url, fleet], stdout=subprocess.PIPE, text=True, check=True)
    found = json.loads(done.stdout)
    bare, plain, sealed = found["bare"], found["plain"], found["sealed"]

    def latency(of):
        return of["p50_us"] / bare["p50_us"]

    def rate(of):
        return of["per_s"] / bare["per_s"]

    for of, name in ((plain, "two bridges"), (sealed, "two bridges of a secured fleet")):
        report.add(f"PULL through {name}, p50", f"{of['p50_us']} us, bare {bare['p50_us']} us: {latency(of):.2f}x",
                   "at most 1.8x", latency(of) <= 1.8)
        report.add("requests a second, 64 in flight", f"{of['per_s']}, bare {bare['per_s']}: {rate(of):.2f}x",
                   "at least 0.5x", rate(of) >= 0.5)


def measure_pools(folder, report):
    with MeasuredServer() as server, subprocess.Popen([folder / "cles_federation_pools", server.url], stdin=subprocess.PIPE,
                                                  stdout=subprocess.PIPE, text=True) as running:
        found = json.loads(running.stdout.readline())
        before = server.counted()
        time.sleep(IDLE)
        after = server.counted()
        running.stdin.write("\n")
        running.stdin.flush()
        updates = json.loads(running.stdout.readline())
    each = {key: (after[key] - before[key]) / IDLE / found["pools"] for key in after}
    report.add(f"UPDATE to {updates['readers']} readers in {updates['reading_pools']} pools",
               f"{updates['publications']} publications for {updates['updates']} updates, {updates['received']} received",
               "one each", updates["publications"] == updates["updates"] and
               updates["received"] == updates["updates"] * updates["readers"])
    report.add(f"{found['pools']} pools of {found['nodes']} nodes", f"found after {found['found_s']} s, all reached after "
               f"{found['reachable_s']} s with {found['requests']} requests", "5 s", found["reachable_s"] <= 5)
    print(f"     traffic of an idle bridge: sends {each['in_msgs']:.1f} messages/s and {each['in_bytes']:.0f} bytes/s, receives "
          f"{each['out_msgs']:.1f} messages/s and {each['out_bytes']:.0f} bytes/s (payload, as the server counts it)", flush=True)


def measure_faults(folder, arguments, report):
    done = subprocess.run([sys.executable, "-B", faults.__file__, folder / "cles_federation_node", *arguments],
                          stdout=subprocess.PIPE, text=True, check=False)
    print("     " + done.stdout.strip(), flush=True)
    found = json.loads(done.stdout)
    report.add("faults: effects twice, broken promises", f"{found['effects_twice']}, {found['problems']}", "none",
               found["effects_twice"] == 0 and found["problems"] == 0)
    report.add("requests under faults", found["requests"], "at least 20000", found["requests"] >= 20_000)
    report.add("whole again after the last fault", f"{found['whole_after_s']} s", "at most 2 s", found["whole_after_s"] <= 2)


def main(folder, *arguments):
    if PROGRAM is None:
        print(MISSING, file=sys.stderr)
        return 77
    report = Report()
    measure_cost(Path(folder), report)
    measure_pools(Path(folder), report)
    measure_faults(Path(folder), arguments, report)
    return 1 if report.failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
