#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Draws the pictures of docs/platoon.md from simulations of `cles-platoon`.

    python3 perf/evaluation/platoon_pictures.py [--programs build/release/apps] [--seeds 1000] [-o docs]
                                                [--figures FILE]

Writes platoon_*.svg, and a JSON file with the figures of those that count failures.
"""

import argparse
import json
import os
import subprocess
import tempfile
from pathlib import Path

from platoon_plot import Chart, around, colour_of, number_of

RATES = (10, 25, 50)
STEP = 4  # every fifth of a second of a record is drawn
SERIES = (("10 % lost", ("--loss", 10), "#1f5fa8"),
          ("10 % in bursts of 3", ("--loss", 10, "--burst", 3), "#c03030"),
          ("10 %, no radar", ("--loss", 10, "--no-radar"), "#77aadd"),
          ("bursts, no radar", ("--loss", 10, "--burst", 3, "--no-radar"), "#e09090"))
MIXED = {"lags": ("--lags", 0.2, 0.5), "lags; brakes 7 to 8": ("--lags", 0.2, 0.5, "--brakes", 7, 8),
         "lags; brakes 5.5 to 8": ("--lags", 0.2, 0.5, "--brakes", 5.5, 8)}
BURSTS = (1.2, 2, 3, 5, 8)


def asked(program, *arguments):
    done = subprocess.run([program, "simulate", *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1, 4):  # 1: a collision; 4: the manoeuvre did not end
        raise SystemExit(f"platoon_pictures.py: {' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


def counted(program, seeds, *arguments):
    found = json.loads(asked(program, *arguments, "--seeds", seeds, "--json"))
    del found["runs"]
    return found


def recorded(program, *arguments):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "record.json"
        asked(program, *arguments, "--record", file)
        return json.loads(file.read_text(encoding="utf-8"))


def highest(rows):
    return max(2.0, *(100 * row["failure_high"] for row in rows)) * 1.05


def failures_chart(found):
    rows = [row for series in found.values() for row in series]
    chart = Chart(f"Drives in which errors grow along the platoon, of {rows[0]['seeds']} each, with 95 % intervals",
                  "updates per second of each vehicle", "% of drives", (5, 55), (0, highest(rows)), x_ticks=RATES)
    for index, (name, _, colour) in enumerate(SERIES):
        for row in found[name]:
            chart.point(row["hz"] + (index - 1.5) * 1.1, 100 * row["failure_rate"], colour, 100 * row["failure_low"],
                        100 * row["failure_high"])
    names = [(name, colour) for name, _, colour in SERIES]
    return legend_inside(chart, names)


def bursts_chart(found):
    rows = [row for series in found.values() for row in series]
    chart = Chart(f"Drives in which errors grow, of {rows[0]['seeds']} each: 10 % of the updates lost in bursts",
                  "mean updates of a burst (independent losses: 1.1)", "% of drives", (0.5, max(BURSTS) + 0.5),
                  (0, highest(rows)), x_ticks=BURSTS)
    colours = {hz: colour_of(i, len(RATES)) for i, hz in enumerate(RATES)}
    for index, hz in enumerate(RATES):
        for row in found[str(hz)]:
            chart.point(row["burst"] + (index - 1) * 0.08, 100 * row["failure_rate"], colours[hz],
                        100 * row["failure_low"], 100 * row["failure_high"])
        chart.curve([row["burst"] for row in found[str(hz)]], [100 * row["failure_rate"] for row in found[str(hz)]],
                    colours[hz])
    return legend_inside(chart, [(f"{hz} Hz", colours[hz]) for hz in RATES], x=90)


def mixed_chart(found):
    """The failure rate of the largest error over that behind the leader."""
    rows = [row for series in found.values() for row in series.values()]
    chart = Chart(f"Drives with an error above 1.02 times that behind the leader, of {rows[0]['seeds']} each, 10 % lost",
                  "updates per second of each vehicle", "% of drives", (5, 55),
                  (0, max(2.0, *(100 * row["above_first_high"] for row in rows)) * 1.05), x_ticks=RATES)
    colours = {name: colour_of(i, len(found)) for i, name in enumerate(found)}
    for index, (name, series) in enumerate(found.items()):
        for row in series.values():
            chart.point(row["hz"] + (index - 1) * 1.1, 100 * row["above_first_rate"], colours[name], 100 * row["above_first_low"],
                        100 * row["above_first_high"])
    return legend_inside(chart, list(colours.items()), top=150)


def legend_inside(chart, entries, x=640, top=72):
    for i, (label, colour) in enumerate(entries):
        y = top + i * 15
        chart.line(x, y - 4, x + 18, y - 4, colour, 'stroke-width="3"')
        chart.text(x + 24, y, label)
    return chart.svg()


def courses_chart(record, what, title, label, least=1.0, marks=()):
    """One line for each vehicle over time; `what` is a member of its course or a function of it."""
    courses = sorted(record["courses"], key=number_of)
    value = what if callable(what) else lambda course: course[what]
    times = record["t"][::STEP]
    lines = [value(course)[::STEP] for course in courses]
    chart = Chart(title, "s", label, (times[0], times[-1]), around([v for line in lines for v in line if v is not None], least))
    colours = [colour_of(i, len(courses)) for i in range(len(courses))]
    for x, text in marks:
        chart.line(chart.x(x), 56, chart.x(x), 352, "#999999", 'stroke-dasharray="3 3"')
        chart.text(chart.x(x) + 4, 68, text, colour="#666666")
    for line, colour in zip(lines, colours):
        chart.curve(times, line, colour)
    chart.legend([(course["vehicle"], colour) for course, colour in zip(courses, colours)])
    return chart.svg()


def behind_leader(record):
    """Of a course, its distance to the leader."""
    leader = next(course for course in record["courses"] if course["vehicle"] == "v0")["place"]
    return lambda course: [None if x is None else first - x for first, x in zip(leader, course["place"])]


def track_chart(record):
    """The track on the earth, with each vehicle at three times."""
    leader = next(course for course in record["courses"] if course["vehicle"] == "v0")
    last = max(record["courses"], key=number_of)
    lons, lats = [*last["lon"], *leader["lon"]], [*last["lat"], *leader["lat"]]
    chart = Chart("The track on the earth: where each vehicle is after 0, 20 and 40 s", "longitude, degrees",
                  "latitude, degrees", around(lons, 1e-4), around(lats, 1e-4))
    chart.curve([lons[0], lons[-1]], [lats[0], lats[-1]], "#bbbbbb")
    courses = sorted(record["courses"], key=number_of)
    for second in (0, 20, 40):
        at = min(range(len(record["t"])), key=lambda i, wanted=second: abs(record["t"][i] - wanted))
        for i, course in enumerate(courses):
            chart.point(course["lon"][at], course["lat"][at], colour_of(i, len(courses)))
    chart.legend([(course["vehicle"], colour_of(i, len(courses))) for i, course in enumerate(courses)])
    return chart.svg()


def drawn(program, seeds):
    """(name of the picture, SVG), and the figures."""
    failures = {name: [counted(program, seeds, "--hz", hz, *options) for hz in RATES] for name, options, _ in SERIES}
    bursts = {str(hz): [counted(program, max(1, seeds // 5), "--hz", hz, "--loss", 10, "--burst", length) for length in BURSTS]
              for hz in RATES}
    mixed = {name: {str(hz): counted(program, seeds, "--hz", hz, "--loss", 10, *options) for hz in RATES}
             for name, options in MIXED.items()}
    mute = recorded(program, "--vehicles", 6, "--mute", "2@10+30", "--brake-at", 100, "--seconds", 80)
    differ = recorded(program, "--vehicles", 8, "--loss", 10, "--lags", 0.2, 0.5, "--brakes", 5.5, 8)
    merge = recorded(program, "--vehicles", 5, "--loss", 10, "--merge", "2@5", "--brake-at", 30, "--seconds", 60)
    split = recorded(program, "--vehicles", 6, "--loss", 10, "--split", "3@5", "--brake-at", 30, "--seconds", 60)
    pictures = {
        "track": track_chart(differ),
        "failures": failures_chart(failures),
        "bursts": bursts_chart(bursts),
        "degradation": courses_chart(mute, "distance", "v2 sends nothing for 30 s: v3 follows it by its radar",
                                     "m to the vehicle ahead", marks=((10, "v2 falls silent"), (40, "v2 sends again"))),
        "differences": courses_chart(differ, "error", "Lags of 0.2 to 0.5 s and brakes of 5.5 to 8 m/s²: spacing error",
                                     "m", least=0.1),
        "mixed": mixed_chart(mixed),
        "merge": courses_chart(merge, behind_leader(merge), "v5 merges between v2 and v3, and later the leader brakes",
                               "m behind the leader", marks=((5, "v5 asks"), (30, "v0 brakes"))),
        "split": courses_chart(split, behind_leader(split), "v3 splits off with those behind it, and later the leader brakes",
                               "m behind the leader", marks=((5, "v3 splits off"), (30, "v0 brakes")))}
    return pictures, {"failures": failures, "bursts": bursts, "mixed": mixed}


def main():
    parser = argparse.ArgumentParser(description="Draws the pictures of docs/platoon.md.")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("-o", "--output", default="docs", help="the folder for the pictures")
    parser.add_argument("--figures", help="a JSON file for the figures")
    options = parser.parse_args()
    pictures, figures = drawn(os.path.join(options.programs, "cles-platoon"), options.seeds)
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    for name, svg in pictures.items():
        (folder / f"platoon_{name}.svg").write_text(svg, encoding="utf-8")
        print(folder / f"platoon_{name}.svg")
    if options.figures:
        Path(options.figures).write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
