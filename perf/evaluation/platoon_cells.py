#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Drives a platoon through each kind of loss: whether vehicles with a radar collide.

    platoon_cells.py [--programs build/release/apps] [--seeds 1000] [--first-seed 1] [--vehicles 20] [--seconds 0]
                     [--hz 10,25,50] [--nodes [--simulation build/release/test/simulation/cles_simulation]] [--failures]
                     [--quick] [-o FILE]

Prints the two tables of docs/platoon.md, of equal vehicles and of vehicles that differ: for each rate and loss, the smallest
gap, the smallest time to a collision, and the collisions, if there are any. It drives by the control law alone, or with
--nodes on simulated nodes. With --failures, it prints the page's table of failures instead: the share of drives in which
errors grow, with 10 % lost. -o writes all figures as JSON. --quick drives one short drive of
each kind. Ends with 1 if vehicles collided.
"""

import argparse
import json
import os
import subprocess
import sys

import result_file

LOSSES = [(0, 0), *((loss, burst) for burst in (0, 10, 30) for loss in (10, 20, 30, 50, 80)), (100, 0)]
RATES = (10, 25, 50)
FAILURES = {"10 %, independently": ("--burst", 0), "10 % in bursts of 3": ("--burst", 3),
            "10 %, independently; no radar": ("--burst", 0, "--no-radar"),
            "10 % in bursts of 3; no radar": ("--burst", 3, "--no-radar")}
FLEETS = {"equal vehicles": (), "lags of 0.2 to 0.5 s, brakes of 5.5 to 8 m/s²": ("--lags", 0.2, 0.5, "--brakes", 5.5, 8)}


def asked(options, hz, seeds, *more):
    program = [options.simulation, "platoon"] if options.nodes else [os.path.join(options.programs, "cles-platoon"), "simulate"]
    arguments = ["--vehicles", options.vehicles, "--hz", hz, "--seeds", seeds, "--first-seed", options.first_seed, "--json", *more]
    if options.seconds:
        arguments += ["--seconds", options.seconds]
    done = subprocess.run([*program, *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1, 4):  # 1: a collision; 4: the manoeuvre did not end: the result contains both
        raise SystemExit(f"platoon_cells.py: {' '.join(map(str, arguments))}: {(done.stderr or done.stdout[:1000]).strip()}")
    return json.loads(done.stdout)


def driven(options, hz, loss, burst, fleet):
    seeds = 1 if loss == 0 and not fleet else options.seeds  # without loss, all drives of equal vehicles are the same
    found = asked(options, hz, seeds, "--loss", loss, "--burst", burst, *fleet)
    return {"hz": hz, "loss_percent": loss, "burst": burst, "seeds": seeds, "collisions": found["collisions"],
            "least_gap": found["least_gap"], "least_time_to_collision": found["least_time_to_collision"],
            "string_ratio": found["string_ratio"], "stand_or_apart": found["broken"]}


def name_of(loss, burst):
    if loss in (0, 100):
        return "nothing" if loss == 0 else "everything"
    return f"{loss} %, " + (f"in bursts of {burst}" if burst else "independently")


def told(cell):
    time = cell["least_time_to_collision"]
    text = f"{cell['least_gap']:.1f} m, " + (f"{time:.1f} s" if time is not None else "never nearer")
    return text + (f", {cell['collisions']} COLLISIONS" if cell["collisions"] else "")


def table(cells, rates):
    lines = ["| updates lost | " + " | ".join(f"{hz} Hz" for hz in rates) + " |", "| --- |" + " --- |" * len(rates)]
    for loss, burst in LOSSES:
        row = [cell for cell in cells if (cell["loss_percent"], cell["burst"]) == (loss, burst)]
        lines.append(f"| {name_of(loss, burst)} | " + " | ".join(map(told, row)) + " |")
    return "\n".join(lines)


def failures(options, rates):
    """The page's table, and its figures."""
    lines = ["| updates lost, radar | " + " | ".join(f"{hz} Hz" for hz in rates) + " |", "| --- |" + " --- |" * len(rates)]
    cells = []
    for name, how in FAILURES.items():
        row = []
        for hz in rates:
            found = asked(options, hz, options.seeds, "--loss", 10, *how)
            cells.append({"hz": hz, "kind": name, "seeds": options.seeds,
                          **{key: found[key] for key in ("failure_rate", "failure_low", "failure_high", "string_ratio", "least_gap",
                                                         "collisions")}})
            gap = f"{found['least_gap']:.1f} m" if not found["collision"] else "a collision"
            row.append(f"{found['failure_rate']:.1%} ({100 * found['failure_low']:.1f} to {100 * found['failure_high']:.1f}), "
                       f"{found['string_ratio']:.2f}, {gap}".replace("%", " %"))
        lines.append(f"| {name} | " + " | ".join(row) + " |")
        print(f"{name}: {row}", file=sys.stderr, flush=True)
    return "\n".join(lines), cells


def main():
    parser = argparse.ArgumentParser(description="Drives a platoon through each kind of loss.")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=0, help="of each drive (until five seconds after the manoeuvre)")
    parser.add_argument("--hz", default=",".join(map(str, RATES)), help="the rates")
    parser.add_argument("--quick", action="store_true", help="one drive of 10 s of each kind")
    parser.add_argument("--nodes", action="store_true", help="on simulated nodes")
    parser.add_argument("--simulation", default="build/release/test/simulation/cles_simulation")
    parser.add_argument("--failures", action="store_true", help="the table of failures")
    parser.add_argument("-o", "--output", help="a file for all figures")
    options = parser.parse_args()
    if options.quick:
        options.seeds, options.seconds = 1, 10
    rates = [int(hz) for hz in options.hz.split(",")]
    if options.failures:
        text, cells = failures(options, rates)
        print(f"{text}\n")
        result = {"failures": cells}
    else:
        fleets = {}
        for name, fleet in FLEETS.items():
            fleets[name] = [driven(options, hz, loss, burst, fleet) for loss, burst in LOSSES for hz in rates]
            print(f"{name}:\n\n{table(fleets[name], rates)}\n", flush=True)
        cells = [cell for each in fleets.values() for cell in each]
        result = {"cells": fleets}
    collisions, drives = (sum(cell[count] for cell in cells) for count in ("collisions", "seeds"))
    if options.output:
        figures = [{"name": "collisions", "what": f"drives that ended in a collision, of {drives}", "value": collisions,
                    "target": 0, "reached": collisions == 0},
                   {"name": "least_gap", "what": "the smallest gap of all drives", "unit": "m",
                    "value": min(cell["least_gap"] for cell in cells)}]
        result_file.write({**result, "figures": figures}, options.output)
    print(f"{collisions} collisions in {drives} drives")
    return 1 if collisions else 0


if __name__ == "__main__":
    sys.exit(main())
