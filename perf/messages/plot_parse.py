#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Draws what `cles bench --parse` measured: time over length, both logarithmic, as SVG.

    cles bench --parse -o json | perf/messages/plot_parse.py > parse.svg
"""

import json
import math
import sys

SERIES = (
    ("typed", "request, read into a C++ type", "#b2182b"),
    ("reply_typed", "reply, read into a C++ type", "#ef8a62"),
    ("validated", "request, body checked", "#2166ac"),
    ("reply_validated", "reply, checked, as text", "#67a9cf"),
    ("head", "request, all head", "#4d9221"),
    ("packed", "packed struct, same numbers", "#555555"),
)
WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 760, 480, 80, 30, 230, 50


def scale(low, high, start, end):
    """The coordinate of a value on a logarithmic scale."""
    span = math.log10(high) - math.log10(low)
    return lambda value: start + (math.log10(value) - math.log10(low)) / span * (end - start)


def bytes_text(count):
    return f"{count >> 20} MiB" if count >= 1 << 20 else f"{count >> 10} KiB" if count >= 1 << 10 else str(count)


def time_text(ns):
    return f"{ns / 1e6:g} ms" if ns >= 1e6 else f"{ns / 1e3:g} us" if ns >= 1e3 else f"{ns:g} ns"


def text(x, y, what, anchor="middle", colour="#000000"):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}">{what}</text>'


def line(x1, y1, x2, y2):
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="#dddddd"/>'


def plot(report):
    rows = report["rows"]
    times = [row[name]["ns"] for row in rows for name, _, _ in SERIES]
    low, high = 10 ** math.floor(math.log10(min(times))), 10 ** math.ceil(math.log10(max(times)))
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    x = scale(rows[0]["bytes"], rows[-1]["bytes"], LEFT, right)
    y = scale(low, high, bottom, TOP)
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
             'font-size="12">', '<rect width="100%" height="100%" fill="#ffffff"/>']
    for row in rows:
        parts += [line(x(row["bytes"]), TOP, x(row["bytes"]), bottom),
                  text(x(row["bytes"]), bottom + 18, bytes_text(row["bytes"]))]
    for power in range(round(math.log10(low)), round(math.log10(high)) + 1):
        parts += [line(LEFT, y(10**power), right, y(10**power)),
                  text(LEFT - 8, y(10**power) + 4, time_text(10**power), "end")]
    parts += [text((LEFT + right) / 2, HEIGHT - 10, "bytes of the message"),
              text(LEFT, TOP - 12, "time for one, median", "start")]
    for i, (name, meaning, colour) in enumerate(SERIES):
        points = " ".join(f'{x(row["bytes"]):.1f},{y(row[name]["ns"]):.1f}' for row in rows)
        parts += [f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>',
                  text(right + 15, TOP + 20 + 20 * i, meaning, "start", colour)]
    return "\n".join([*parts, "</svg>"])


if __name__ == "__main__":
    print(plot(json.load(sys.stdin)))
