#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures a platoon: whether errors grow along it, in virtual time from many seeds, and how long updates take when each
vehicle is a process.

    platoon.py [--programs build/release/apps] [--seeds 1000] [--vehicles 20] [--seconds 60] [--drives 5] [--quick]
               [-o FILE] [--plots FOLDER]

Writes JSON: the string ratio at 10, 25 and 50 Hz, without loss, with 10 % lost independently and with 10 % lost in bursts,
as the largest one and as the share of drives above 1.02 with its 95 % interval; the same of a controller that does not heed
the leader, from at most 20 seeds; drives of processes at those rates with the string ratio, the least gap and the latencies of updates, at 50 Hz several
in turn, of which the median counts; a drive in which the leader, one in the middle, or the last is killed.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import platoon_plot
from interval import summary
from linked_hosts import free_group
from provenance import command, date, machine
from result_file import write

MOST_RATIO, MOST_P999_MS, BUDGET_MS = 1.02, 2, 100
MOST_FAILURES = 0.01  # of the drives; the upper limit of the interval counts
BURST = 3  # updates, on average


def asked(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1, 4):  # 1: a collision; 4: the manoeuvre did not end: the result contains both
        raise SystemExit(f"platoon.py: {' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def simulated(program, vehicles, seeds):
    rows = []
    for controller in ("leader", "predecessor"):
        for hz in (10, 25, 50):
            for loss, burst in ((0, 0), (10, 0), (10, BURST)):
                # Without loss, all seeds are the same.
                count = 1 if loss == 0 else seeds if controller == "leader" else min(seeds, 20)
                found = asked(program, "simulate", "--vehicles", vehicles, "--hz", hz, "--loss", loss, "--burst", burst,
                              "--seeds", count, "--controller", controller, "--json")
                ratios = sorted(run["string_ratio"] for run in found["runs"])
                rows.append({"controller": controller, "hz": hz, "loss_percent": loss, "burst": burst, "vehicles": vehicles,
                             "seeds": count, "string_ratio": found["string_ratio"],
                             "median_ratio": ratios[len(ratios) // 2],
                             "unstable": found["unstable"], "failure_rate": found["failure_rate"],
                             "failure_low": found["failure_low"], "failure_high": found["failure_high"],
                             "ratios": ratios, "least_gap": found["least_gap"], "collision": found["collision"],
                             "collisions": found["collisions"], "fallbacks_per_run": found["fallbacks"],
                             "radar_spells_per_run": found["radar_spells"]})
    return rows


def driven(program, vehicles, seconds, record, *more):
    run = [program, "run", "--vehicles", vehicles, "--seconds", seconds, "--multicast", free_group(), "--json", *more]
    if record:
        run += ["--record", record]
    found = asked(*run)
    latency = {name: value for name, value in found["latency"].items() if name != "curve"}
    return {"hz": found["hz"], "loss_percent": found["loss"] * 100, "vehicles": found["vehicles"], "seconds": seconds,
            "steady": found["steady"], "string_ratio": found["verdict"]["string_ratio"] if found["steady"] else None,
            "least_gap": found["verdict"]["least_gap"], "collision": found["verdict"]["collision"],
            "fallbacks": found["fallbacks"], "latency": latency, "missed": found["missed"],
            "events": [e for e in found["events"] if e["mode"] in ("killed", "gone")]}


def checks_of(rows, drives, kills):
    lossy = [row for row in rows if row["loss_percent"] == 10]
    fast = fastest(drives)
    return {"string_ratio": {name_of(row): row["string_ratio"] for row in lossy if row["controller"] == "leader"},
            "string_ratio_wanted": MOST_RATIO,
            "failures": {name_of(row): [row["failure_low"], row["failure_rate"], row["failure_high"]]
                         for row in lossy if row["controller"] == "leader"},
            "failures_wanted": MOST_FAILURES,
            "without_leader_fails": all(row["string_ratio"] > MOST_RATIO
                                        for row in lossy if row["controller"] == "predecessor"),
            "p999_ms_at_50_hz": fast, "p999_ms_wanted": MOST_P999_MS,
            "p999_reached": all(summary(found)["median"] <= MOST_P999_MS for found in fast.values()),
            "nobody_collides": not any(r["collision"] for r in [*rows, *drives, *kills] if r.get("controller") != "predecessor"),
            "over_budget": sum(d["latency"]["late"] for d in drives)}


def name_of(row):
    return f"{row['hz']} Hz" + (", bursts" if row["burst"] else "")


def fastest(drives):
    """{loss in percent: the sorted p99.9 of its drives at 50 Hz, in ms}"""
    found = {}
    for drive in drives:
        if drive["hz"] == 50:
            found.setdefault(f"{drive['loss_percent']:g}", []).append(drive["latency"]["p999_us"] / 1e3)
    return {loss: sorted(each) for loss, each in found.items()}


def figure(name, what, value, unit="", runs=1, target=None, reached=None, low=None, high=None):
    return {"name": name, "what": what, "value": value, "low": low, "high": high, "runs": runs, "unit": unit,
            "paper": None, "target": target, "reached": reached}


def figures_of(checks, rows, drives):
    """The checks in the form that the report reads."""
    for row in rows:
        if row["loss_percent"] == 0:
            continue
        heeds = row["controller"] == "leader"
        name = f"{row['controller']}_{row['hz']}" + ("_bursts" if row["burst"] else "")
        lost = f"10 % lost in bursts of {row['burst']} updates" if row["burst"] else "10 % lost"
        how = "following the leader too" if heeds else "following only the vehicle ahead, for comparison"
        yield figure(f"string_failures_{name}",
                     f"drives at {row['hz']} Hz with {lost} whose string ratio is above {MOST_RATIO:g}, {how}",
                     100 * row["failure_rate"], "%", runs=row["seeds"], low=100 * row["failure_low"],
                     high=100 * row["failure_high"], target=f"\u2264 {100 * MOST_FAILURES:g}" if heeds else None,
                     reached=row["failure_high"] <= MOST_FAILURES if heeds else None)
        yield figure(f"string_ratio_{name}", f"string ratio at {row['hz']} Hz with {lost}, the largest of all seeds, {how}",
                     row["string_ratio"], runs=row["seeds"])
    yield figure("without_leader_fails", f"without the leader the ratio is above {MOST_RATIO:g} at each rate",
                 "yes" if checks["without_leader_fails"] else "no", target="yes", reached=checks["without_leader_fails"])
    for loss, found in checks["p999_ms_at_50_hz"].items():
        p999 = summary(found)
        yield figure(f"p999_50_hz_{loss}", f"an update from one process to another, p99.9, at 50 Hz with {loss} % lost",
                     p999["median"], "ms", runs=len(found), target=f"\u2264 {MOST_P999_MS:g}",
                     reached=p999["median"] <= MOST_P999_MS, low=p999["low"], high=p999["high"])
    yield figure("over_budget", f"updates between processes that took more than {BUDGET_MS} ms", checks["over_budget"],
                 runs=len(drives), target="0", reached=checks["over_budget"] == 0)
    yield figure("nobody_collides", "no collision in any drive that follows the leader too",
                 "yes" if checks["nobody_collides"] else "no", target="yes", reached=checks["nobody_collides"])


def pictures_of(record):
    titles = {"speed": "Speed of each vehicle", "error": "Spacing error of each vehicle",
              "latency": "Latency of updates between processes"}
    return [{"name": name, "title": f"{titles[name]}: {platoon_plot.described(record)}", "svg": svg}
            for name, svg in platoon_plot.charts_of(record).items()]


def main():
    parser = argparse.ArgumentParser(description="Measures a platoon.")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--vehicles", type=int, default=20)
    parser.add_argument("--seconds", type=int, default=60, help="of each drive of processes")
    parser.add_argument("--drives", type=int, default=5, help="of processes, at 50 Hz with each loss")
    parser.add_argument("--quick", action="store_true", help="small and short: shows that it works, not how fast")
    parser.add_argument("--plots", help="a folder for plots of the drives, at each rate and loss of the last")
    parser.add_argument("-o", "--output", default="-")
    options = parser.parse_args()
    if options.drives < 1:
        parser.error("--drives: at least one")
    if options.quick:
        options.seeds, options.vehicles, options.seconds, options.drives = 2, 4, 8, 1
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    program = os.path.join(options.programs, "cles-platoon")
    before = machine()  # before anything runs
    print("platoon: in virtual time", file=sys.stderr, flush=True)
    rows = simulated(program, options.vehicles, options.seeds)
    drives, pictures = [], []
    slower = [] if options.quick else [(hz, loss) for hz in (10, 25) for loss in (0, 10)]
    for hz, loss in slower + [(50, loss) for _ in range(options.drives) for loss in ((10,) if options.quick else (0, 10))]:
        print(f"platoon: processes at {hz} Hz, {loss} % lost", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory() as passing:
            folder = Path(options.plots) / f"{hz}hz_{loss}_percent" if options.plots else Path(passing)
            folder.mkdir(parents=True, exist_ok=True)
            file = folder / "record.json"
            drives.append(driven(program, options.vehicles, options.seconds, file, "--hz", hz, "--loss", loss))
            record = json.loads(file.read_text(encoding="utf-8"))
        if options.plots:
            platoon_plot.draw(record, folder)
        pictures = pictures_of(record)  # of the last one: losses at the highest rate
    last = options.vehicles - 1
    kills = [{"killed": who, **driven(program, options.vehicles, 8 if options.quick else 25, None, "--hz", 25,
                                      "--vanish", f"{who}@4")}
             for who in ((last // 2,) if options.quick else (0, last // 2, last))]
    checks = checks_of(rows, drives, kills)
    result = {"title": "Platooning (section 4.2 of the paper; Swaroop and Hedrick's law)", "simulated": rows,
              "driven": drives, "killed": kills, "checks": checks, "quick": options.quick, "machine": before,
              "figures": list(figures_of(checks, rows, drives)), "pictures": pictures, "date": date(),
              "command": command("perf/evaluation/platoon.py")}
    write(result, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
