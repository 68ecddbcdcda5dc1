#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures with `cles bench` what section 4.1 of the paper reports: PULL against a hand-written exchange (Fig. 3), the
size of packets, the cost of parsing by length; and the way of updates to many binders.

    bench.py [--programs build/release/apps] [--rounds 15] [--quick] [-o FILE]

Writes JSON. The rounds of all exchanges take turns, so that other load on the machine affects all of them. A
ratio is the median over the rounds of CLES divided by the hand-written exchange of the same round; the interval is that
of the median, with 95 % confidence. Ends with 1 where a measurement failed: the others are still written.
"""

import argparse
import json
import os
import subprocess
import sys

import bench_figures
from clean_environment import clean_environment
from provenance import command, date, machine
from result_file import write

PULLS = {"tcp": ["--transport", "tcp"], "udp": ["--transport", "udp"], "unix": ["--transport", "unix"],
         "polling": ["--transport", "tcp", "--busy-poll", "50"]}
FAN_OUTS = ("tcp", "unix", "multicast")


class Failed(Exception):
    pass


class Bench:
    """Calls `cles bench`, and counts the calls."""

    def __init__(self, programs, calls):
        self.program, self.calls, self.done = os.path.join(programs, "cles"), calls, 0

    def __call__(self, *arguments):
        try:
            ended = subprocess.run([self.program, "bench", *arguments, "-o", "json"], stdin=subprocess.DEVNULL,
                                   capture_output=True, text=True, timeout=900, check=False,
                                   env=clean_environment())
        except subprocess.TimeoutExpired as failure:
            raise Failed(f"cles bench {' '.join(arguments)}: not done after 15 minutes") from failure
        if ended.returncode != 0:
            raise Failed(f"cles bench {' '.join(arguments)}: {ended.stderr.strip()}")
        self.done += 1
        print(f"\rbench: {self.done} of {self.calls} runs", end="", file=sys.stderr, flush=True)
        return json.loads(ended.stdout)


def in_turns(bench, kinds, rounds, failures):
    """{kind: its reports}, of kinds {kind: arguments}. A kind that fails once is left out, and added to the failures."""
    reports = {kind: [] for kind in kinds}
    for turn in range(rounds):
        names = list(reports)
        at = turn % len(names) if names else 0
        for name in names[at:] + names[:at]:
            try:
                reports[name].append(bench("--rounds", "1", *kinds[name]))
            except Failed as failure:
                failures.append({"what": name, "reason": str(failure)})
                del reports[name]
    return reports


def measure(options, failures):
    pulls = {f"pull_{name}": [*words, "--requests", str(options.requests)] for name, words in PULLS.items()}
    parse = {"parse": ["--parse", *(["--requests", "3"] if options.quick else [])]}
    fan_outs = {f"fan_out_{name}": ["--fan-out", "--transport", name, *(["--requests", "50"] if options.quick else [])]
                for name in FAN_OUTS}
    few = max(2, options.rounds // 3)
    bench = Bench(options.programs, len(pulls) * options.rounds + (1 + len(fan_outs)) * few + 1)
    reports = {**in_turns(bench, pulls, options.rounds, failures), **in_turns(bench, parse, few, failures),
               **in_turns(bench, fan_outs, few, failures)}
    try:
        reports["bytes"] = [bench("--bytes", *(["--requests", "50"] if options.quick else []))]
    except Failed as failure:
        failures.append({"what": "bytes", "reason": str(failure)})
    print(file=sys.stderr)
    return reports


def parsed_arguments():
    parser = argparse.ArgumentParser(description="Measures PULL, bytes, parsing and fan-out (the paper's section 4.1).")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--rounds", type=int, default=15, help="of each PULL; a third as many of the longer ones")
    parser.add_argument("--requests", type=int, default=20_000, help="in each round of PULL")
    parser.add_argument("--quick", action="store_true", help="3 short rounds: shows that it works, not how fast")
    parser.add_argument("-o", "--output", default="-")
    options = parser.parse_args()
    if options.rounds < 1 or options.requests < 1:
        parser.error("--rounds and --requests take numbers from 1 on")
    if options.quick:
        options.rounds, options.requests = 3, 300
    return options


def main():
    options = parsed_arguments()
    if not os.access(os.path.join(options.programs, "cles"), os.X_OK):
        raise SystemExit(f"bench.py: there is no program {os.path.join(options.programs, 'cles')}: build it first")
    failures, before = [], machine()  # before anything runs
    reports = measure(options, failures)
    if not any(reports.values()):
        raise SystemExit("bench.py: nothing could be measured: " + "; ".join(f["reason"] for f in failures))
    result = {"title": "Point to point: PULL, packet size, parsing, fan-out (section 4.1, Fig. 3)",
              "command": command("perf/evaluation/bench.py"), "machine": before, "date": date(),
              "quick": options.quick, "rounds": options.rounds, "skipped": failures,
              "figures": bench_figures.figures(reports), "series": bench_figures.series(reports)}
    write(result, options.output)
    for failure in failures:
        print(f"bench.py: {failure['what']}: {failure['reason']}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
