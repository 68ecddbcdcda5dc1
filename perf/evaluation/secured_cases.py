#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures what security costs the case studies: a platoon and orders to strike, with and without it in turn.

    secured_cases.py [--programs build/release/apps] [--rounds 10] [--vehicles 10] [--hz 50] [--seconds 20] [--orders 1000]
                     [--quick] [-o FILE]

A round is a drive of the platoon without security and one with sealed and signed states, then the same number of orders to
three strike aircraft that do nothing else: without security, over sealed links, and over sealed links with signed orders.
Every other round does so in the reverse order. Writes JSON: the medians over the rounds, with 95 % intervals.
"""

import argparse
import json
import os
import signal
import subprocess
import sys

from clean_environment import clean_environment
from deferred_signals import DeferredSignals
from interval import summary
from linked_hosts import free_group
from provenance import command, date, machine
from result_file import write

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts"))
from jadc2_fleet import RIGHTS, Fleet  # noqa: E402

DRIVES = {"plain": "without security", "secured": "sealed, with signed states"}
ORDERS = {"plain": "without security", "sealed": "over sealed links", "signed": "over sealed links, signed"}


def asked(options, program, *arguments, may_end_with=(0,)):
    process = None
    try:
        with DeferredSignals():
            process = subprocess.Popen([os.path.join(options.programs, program), *map(str, arguments)], text=True,
                                       stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                       env=clean_environment())
        said, complaint = process.communicate()
    finally:
        if process is not None and process.poll() is None:
            process.terminate()  # then it removes its keys
            process.communicate()
    if process.returncode not in may_end_with:
        raise SystemExit(f"secured_cases.py: {program} {arguments[0]} ended with {process.returncode}: {complaint.strip()}")
    return json.loads(said)


def driven(options, kind):
    found = asked(options, "cles-platoon", "run", "--vehicles", options.vehicles, "--hz", options.hz, "--seconds",
                  options.seconds, "--multicast", free_group(), "--json", *(["--secured"] if kind == "secured" else []),
                  may_end_with=(0, 1, 4))  # 1: a collision; 4: the manoeuvre did not end: the result contains both
    latency = {name: value for name, value in found["latency"].items() if name != "curve"}
    return {"latency": latency, "missed": found["missed"], "fallbacks": found["fallbacks"], "steady": found["steady"],
            "string_ratio": found["verdict"]["string_ratio"], "least_gap": found["verdict"]["least_gap"],
            "collision": found["verdict"]["collision"]}


def drilled(options, fleet, striker):
    return asked(options, "cles-jadc2", "drill", "--at", striker.url, "--count", options.orders, *fleet.keys_option("mission"))


def measure(options):
    drives, orders = {kind: [] for kind in DRIVES}, {kind: [] for kind in ORDERS}
    with Fleet(options.programs) as plain, Fleet(options.programs, rights=RIGHTS) as sealed, \
            Fleet(options.programs, rights=RIGHTS) as signed:
        unsigned = f"{{path: {sealed.plugin('strike')}, config: {{must_be_signed: false}}}}"
        nodes = {"plain": (plain, plain.striker()), "sealed": (sealed, sealed.striker(plugins=[unsigned])),
                 "signed": (signed, signed.striker())}
        for fleet, striker in nodes.values():  # warms up
            drilled(options, fleet, striker)
        for number in range(options.rounds):
            for kind in sorted(DRIVES, reverse=number % 2 == 1):
                drives[kind].append(driven(options, kind))
            for kind in sorted(ORDERS, reverse=number % 2 == 1):
                orders[kind].append(drilled(options, *nodes[kind]))
            print(f"\rsecured cases: {number + 1} of {options.rounds} rounds", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return drives, orders


def figure(name, what, values, unit):
    found = summary(values)
    return {"name": name, "what": what, "value": found["median"], "low": found["low"], "high": found["high"],
            "runs": found["runs"], "unit": unit, "paper": None, "target": None, "reached": None}


def figures(drives, orders):
    for kind, how in DRIVES.items():
        for quantile in ("p50", "p99", "p999"):
            yield figure(f"update_{kind}_{quantile}", f"an update of the platoon, {how}, {quantile}",
                         [each["latency"][f"{quantile}_us"] for each in drives[kind]], "us")
        yield figure(f"string_ratio_{kind}", f"the string ratio of the platoon, {how}",
                     [each["string_ratio"] for each in drives[kind]], "")
    for kind, how in ORDERS.items():
        for quantile in ("p50", "p99"):
            yield figure(f"strike_{kind}_{quantile}", f"an order to strike, {how}, {quantile}",
                         [each[f"{quantile}_us"] for each in orders[kind]], "us")


def main():
    parser = argparse.ArgumentParser(description="Measures what security costs the case studies.")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--vehicles", type=int, default=10)
    parser.add_argument("--hz", type=int, default=50)
    parser.add_argument("--seconds", type=int, default=20, help="of each drive")
    parser.add_argument("--orders", type=int, default=1000, help="of each kind in each round")
    parser.add_argument("--quick", action="store_true", help="one short round: shows that it works, not how fast")
    parser.add_argument("-o", "--output", default="-")
    options = parser.parse_args()
    if options.rounds < 1:
        parser.error("--rounds: at least one")
    if options.quick:
        options.rounds, options.vehicles, options.seconds, options.orders = 1, 3, 7, 50
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what it started is ended
    before = machine()  # before anything runs
    drives, orders = measure(options)
    result = {"title": "What security costs the case studies", "command": command("perf/evaluation/secured_cases.py"),
              "machine": before, "date": date(), "quick": options.quick, "vehicles": options.vehicles, "hz": options.hz,
              "seconds": options.seconds, "orders": options.orders, "figures": list(figures(drives, orders)),
              "drives": drives, "drills": orders}
    write(result, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
