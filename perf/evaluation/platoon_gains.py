#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures how much larger the errors, speeds and accelerations of each vehicle of a platoon are than those of the one ahead,
by the control law alone: in both halves of the manoeuvre, and at single frequencies.

    platoon_gains.py [--programs build/release/apps] [--vehicles 20] [--hz 25] [--periods 2,3,4,6,8,12,20,30,60]
                     [--quick] [-o FILE]

Prints the two tables of docs/platoon.md: the gains of the first follower over the leader (of its error, that of the second one
over the first), and the largest of all others; at single frequencies, also the largest acceleration over that of the leader.
No update is lost. -o writes the gains of each vehicle as JSON. --quick drives five vehicles and two sines.
"""

import argparse
import json
import os
import subprocess
import sys

import result_file

KINDS = ("error", "speed", "acceleration")


def simulated(options, *arguments):
    words = ["--vehicles", options.vehicles, "--hz", options.hz, "--json", *arguments]
    done = subprocess.run([os.path.join(options.programs, "cles-platoon"), "simulate", *map(str, words)],
                          capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):  # 1: a collision
        raise SystemExit(f"platoon_gains.py: {' '.join(map(str, words))}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def told(gains):
    known = [gain for gain in gains[1:] if gain is not None]
    first = f"{gains[0]:.3f}" if gains and gains[0] is not None else "none"
    return f"{first}; {max(known):.3f}" if known else first


def over_leader(gains):
    """The largest product of the gains from the leader on."""
    most = product = 1
    for gain in gains:
        if gain is None:
            break
        product *= gain
        most = max(most, product)
    return most


def table(heading, rows, periodic):
    lines = [f"| {heading} | errors | speeds | accelerations |" + (" accelerations over the leader's |" if periodic else ""),
             "| --- |" + " --- |" * (4 if periodic else 3)]
    for name, gains in rows.items():
        lines.append(f"| {name} | " + " | ".join(told(gains[kind]) for kind in KINDS) + " |" +
                     (f" {over_leader(gains['acceleration']):.3f} |" if periodic else ""))
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description="Measures the gains from vehicle to vehicle, in time and in frequency.")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--hz", type=int, default=25)
    parser.add_argument("--periods", default="2,3,4,6,8,12,20,30,60", help="of the sine, s")
    parser.add_argument("--quick", action="store_true", help="five vehicles and two sines")
    parser.add_argument("-o", "--output", help="a file for the gains of each vehicle")
    options = parser.parse_args()
    if options.quick:
        options.vehicles, options.periods = 5, "4,20"
    drive = simulated(options)
    halves = {"braking": drive["braking"], "recovery": drive["recovery"]}
    print(table("half of the manoeuvre", halves, periodic=False) + "\n", flush=True)
    sines = {f"{float(period):g} s": simulated(options, "--sine", float(period))["sine"]
             for period in options.periods.split(",")}
    print(table("period of the sine", sines, periodic=True))
    if options.output:
        figures = [{"name": f"{half}_error_gain", "value": max(filter(None, gains["error"])), "unit": "times",
                    "ran": f"cles-platoon simulate --vehicles {options.vehicles} --hz {options.hz}",
                    "what": f"largest gain of the error from vehicle to vehicle, {half}"} for half, gains in halves.items()]
        result_file.write({"vehicles": options.vehicles, "hz": options.hz, "halves": halves, "sines": sines,
                           "figures": figures}, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
