#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures a platoon: whether errors grow along it, in virtual time from many seeds, and how long updates take when each
vehicle is a process.

    platoon.py [--programs build/release/apps] [--seeds 20] [--vehicles 20] [--seconds 60] [--drives 5] [--quick]
               [-o FILE] [--plots FOLDER]

Writes JSON: the string ratio at 10, 25 and 50 Hz, without loss and at 10 %, and of a controller that does not heed the
leader; drives of processes at those rates with the string ratio, the least gap and the latencies of updates, at 50 Hz several
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


def asked(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):  # 1: a collision, which the result contains
        raise SystemExit(f"platoon.py: {' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def simulated(program, vehicles, seeds):
    rows = []
    for controller in ("leader", "predecessor"):
        for hz in (10, 25, 50):
            for loss in (0, 10):
                found = asked(program, "simulate", "--vehicles", vehicles, "--hz", hz, "--loss", loss, "--seeds", seeds,
                              "--controller", controller, "--json")
                ratios = sorted(run["string_ratio"] for run in found["runs"])
                rows.append({"controller": controller, "hz": hz, "loss_percent": loss, "vehicles": vehicles,
                             "seeds": seeds, "string_ratio": found["string_ratio"],
                             "median_ratio": ratios[len(ratios) // 2],
                             "seeds_within": sum(r <= MOST_RATIO for r in ratios), "ratios": ratios,
                             "least_gap": found["least_gap"], "collision": found["collision"],
                             "fallbacks_per_run": found["fallbacks"]})
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
    return {"string_ratio": {f"{row['hz']} Hz": row["string_ratio"] for row in lossy if row["controller"] == "leader"},
            "string_ratio_wanted": MOST_RATIO,
            "string_ratio_reached": {f"{row['hz']} Hz": row["string_ratio"] <= MOST_RATIO
                                     for row in lossy if row["controller"] == "leader"},
            "without_leader_fails": all(row["string_ratio"] > MOST_RATIO
                                        for row in lossy if row["controller"] == "predecessor"),
            "p999_ms_at_50_hz": fast, "p999_ms_wanted": MOST_P999_MS,
            "p999_reached": all(summary(found)["median"] <= MOST_P999_MS for found in fast.values()),
            "nobody_collides": not any(r["collision"] for r in [*rows, *drives, *kills] if r.get("controller") != "predecessor"),
            "over_budget": sum(d["latency"]["late"] for d in drives)}


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
    """The checks in the form that the report reads. The largest ratio counts, not the median one."""
    within = f"\u2264 {MOST_RATIO:g}"
    lossy = [row for row in rows if row["loss_percent"] == 10]
    for row in lossy:
        heeds = row["controller"] == "leader"
        yield figure(f"string_ratio_{row['controller']}_{row['hz']}",
                     f"string ratio at {row['hz']} Hz with 10 % lost, the largest of all seeds, "
                     + ("following the leader too" if heeds else "following only the vehicle ahead, for comparison"),
                     row["string_ratio"], runs=row["seeds"], target=within if heeds else None,
                     reached=checks["string_ratio_reached"][f"{row['hz']} Hz"] if heeds else None)
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
    parser.add_argument("--seeds", type=int, default=20)
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
