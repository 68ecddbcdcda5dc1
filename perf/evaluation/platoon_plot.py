#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Draws what `cles-platoon --record FILE` wrote: speed and spacing error of each vehicle, and how long updates took.

    platoon_plot.py RECORD [-o FOLDER]

Writes speed.svg, error.svg and, where vehicles were processes, latency.svg.
"""

import argparse
import json
import math
import sys
from pathlib import Path

WIDTH, HEIGHT = 860, 400
LEFT, RIGHT, TOP, BOTTOM = 64, 96, 56, 48
BUDGET_MS = 100
INK, GRID = "#333333", "#dddddd"


def ticks_of(low, high, about=6):
    """Round numbers between two values."""
    step = 10 ** math.floor(math.log10((high - low) / about))
    step *= next(m for m in (1, 2, 5, 10) if (high - low) / (step * m) <= about)
    first = math.ceil(low / step - 1e-9)
    return [round(i * step, 10) for i in range(first, math.floor(high / step + 1e-9) + 1)]


def colour_of(index, count):
    """From red, the leader, to blue, the last."""
    return f"hsl({240 * index / max(1, count - 1):.0f},70%,45%)"


class Chart:
    def __init__(self, title, x_label, y_label, x_range, y_range, log_x=False, x_ticks=None):
        self.x_range, self.y_range, self.log_x = x_range, y_range, log_x
        self.parts = [f'<text x="{LEFT}" y="24" font-size="15">{title}</text>']
        if not x_ticks:
            x_ticks = [10**i for i in range(round(math.log10(x_range[0])), round(math.log10(x_range[1])) + 1)] if log_x \
                else ticks_of(*x_range)
        for value in x_ticks:
            x = self.x(value)
            self.line(x, TOP, x, HEIGHT - BOTTOM, GRID)
            self.text(x, HEIGHT - BOTTOM + 18, f"{value:g}", "middle")
        for value in ticks_of(*y_range):
            y = self.y(value)
            self.line(LEFT, y, WIDTH - RIGHT, y, GRID)
            self.text(LEFT - 8, y + 4, f"{value:g}", "end")
        self.line(LEFT, HEIGHT - BOTTOM, WIDTH - RIGHT, HEIGHT - BOTTOM, INK)
        self.line(LEFT, TOP, LEFT, HEIGHT - BOTTOM, INK)
        self.text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 10, x_label, "middle")
        self.text(LEFT - 8, TOP - 10, y_label, "start")

    def x(self, value):
        low, high = self.x_range
        part = math.log(value / low) / math.log(high / low) if self.log_x else (value - low) / (high - low)
        return LEFT + part * (WIDTH - LEFT - RIGHT)

    def y(self, value):
        low, high = self.y_range
        return HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - TOP - BOTTOM)

    def line(self, x1, y1, x2, y2, colour, more=""):
        self.parts.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}" {more}/>')

    def text(self, x, y, label, anchor="start", colour=INK):
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}">{label}</text>')

    def curve(self, xs, ys, colour):
        """A line through the points, interrupted at missing values."""
        run = []
        for x, y in [*zip(xs, ys), (0, None)]:
            if y is not None:
                run.append(f"{self.x(x):.1f},{self.y(y):.1f}")
            elif run:
                self.parts.append(f'<polyline points="{" ".join(run)}" fill="none" stroke="{colour}" stroke-width="1.4"/>')
                run = []

    def point(self, x, y, colour, low=None, high=None):
        """A point with its interval."""
        if low is not None:
            self.line(self.x(x), self.y(low), self.x(x), self.y(high), colour, 'stroke-width="2"')
            for end in (low, high):
                self.line(self.x(x) - 4, self.y(end), self.x(x) + 4, self.y(end), colour, 'stroke-width="2"')
        self.parts.append(f'<circle cx="{self.x(x):.1f}" cy="{self.y(y):.1f}" r="3.5" fill="{colour}"/>')

    def legend(self, entries):
        """(text, colour) from the top down, as many as fit."""
        for i, (label, colour) in enumerate(entries[:22]):
            y = TOP + 8 + i * 14.5
            self.line(WIDTH - RIGHT + 12, y - 4, WIDTH - RIGHT + 30, y - 4, colour, 'stroke-width="3"')
            self.text(WIDTH - RIGHT + 36, y, label)

    def svg(self):
        return (f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
                f'font-size="11" fill="{INK}"><rect width="100%" height="100%" fill="white"/>'
                + "\n".join(self.parts) + "</svg>\n")


def number_of(course):
    return int("".join(c for c in course["vehicle"] if c.isdigit()) or 0)


def around(values, least):
    """A range that contains all values with a margin, and has a minimum height."""
    low, high = min(values), max(values)
    air = max((high - low) * 0.06, (least - (high - low)) / 2)
    return low - air, high + air


def described(record):
    return (f"{record['vehicles']} vehicles at {record['hz']:g} Hz, {record['loss'] * 100:g} % of the updates lost, "
            f"{record['source']}")


def course_chart(record, what, title, label, least):
    courses = sorted(record["courses"], key=number_of)
    values = [v for course in courses for v in course[what] if v is not None]
    if not values:
        return None
    times = record["t"]
    chart = Chart(f"{title}: {described(record)}", "s", label, (times[0], times[-1]), around(values, least))
    colours = [colour_of(i, len(courses)) for i in range(len(courses))]
    for course, colour in zip(courses, colours):
        chart.curve(times, course[what], colour)
    chart.legend([(course["vehicle"], colour) for course, colour in zip(courses, colours)])
    return chart.svg()


def latency_chart(record):
    found = record["latency"]
    if not found["count"]:
        return None
    low = 10 ** math.floor(math.log10(max(1e-3, found["curve"][0] / 1e3)))
    high = 10 ** math.ceil(math.log10(max(BUDGET_MS * 2, found["max_us"] / 1e3)))
    chart = Chart(f"Latency of {found['count']} updates: {described(record)}", "ms, from sending to reading",
                  "part of the updates", (low, high), (0, 1), log_x=True)
    curve = found["curve"]
    chart.curve([max(low, us / 1e3) for us in curve], [i / (len(curve) - 1) for i in range(len(curve))], "#1f5fa8")
    marks = [("p50", found["p50_us"], 0.5), ("p99", found["p99_us"], 0.99), ("p99.9", found["p999_us"], 0.999)]
    for i, (name, us, part) in enumerate(marks):
        x = chart.x(us / 1e3)
        chart.line(x, chart.y(part), x, chart.y(0), "#1f5fa8", 'stroke-dasharray="3 3"')
        chart.text(x + 4, chart.y(0.42 - 0.08 * i), f"{name} {us / 1e3:.3f} ms", colour="#1f5fa8")
    chart.line(chart.x(BUDGET_MS), TOP, chart.x(BUDGET_MS), HEIGHT - BOTTOM, "#c03030", 'stroke-width="2"')
    chart.text(chart.x(BUDGET_MS) - 6, HEIGHT - BOTTOM - 14, f"the budget, {BUDGET_MS} ms", "end", "#c03030")
    return chart.svg()


def charts_of(record):
    """{name: SVG} for the data that exists."""
    charts = {"speed": course_chart(record, "speed", "Speed", "m/s", 1),
              "error": course_chart(record, "error", "Spacing error", "m", 0.1),
              "latency": latency_chart(record)}
    return {name: svg for name, svg in charts.items() if svg}


def draw(record, folder):
    """Returns the names of the files that it has written."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    charts = charts_of(record)
    for name, svg in charts.items():
        (folder / f"{name}.svg").write_text(svg, encoding="utf-8")
    return [f"{name}.svg" for name in charts]


def main():
    parser = argparse.ArgumentParser(description="Draws a record of cles-platoon.")
    parser.add_argument("record")
    parser.add_argument("-o", "--output", default=".", help="the folder for the plots")
    options = parser.parse_args()
    try:
        with open(options.record, encoding="utf-8") as file:
            record = json.load(file)
        written = draw(record, options.output)
    except (OSError, ValueError, KeyError, TypeError) as problem:
        raise SystemExit(f"platoon_plot.py: {options.record}: {problem}") from None
    print("\n".join(str(Path(options.output) / name) for name in written))


if __name__ == "__main__":
    sys.exit(main())
