#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A leader of another make, which tells only what the paper names as the least: its states, as lines for `cles publish`.

    foreign_leader.py START_UTC BRAKE_AT SECONDS | cles publish v0:state
"""

import json
import math
import sys
import time

LAT, LON, HEADING, HZ = 48.137, 11.575, math.radians(30), 25  # of the road
SPEED, SLOW, BRAKE, SLOW_FOR = 25, 22, -3, 1


def place(x):
    """Latitude and longitude after x metres, on WGS 84."""
    flat, sine = 0.00669438, math.sin(math.radians(LAT)) ** 2
    meridian = 6378137 * (1 - flat) / (1 - flat * sine) ** 1.5
    parallel = 6378137 / math.sqrt(1 - flat * sine) * math.cos(math.radians(LAT))
    return LAT + math.degrees(x * math.cos(HEADING) / meridian), LON + math.degrees(x * math.sin(HEADING) / parallel)


def acceleration_at(t, brake_at):
    slow_from = brake_at + (SLOW - SPEED) / BRAKE
    return BRAKE if brake_at <= t < slow_from else 1 if slow_from + SLOW_FOR <= t < slow_from + SLOW_FOR + SPEED - SLOW else 0


def main(start, brake_at, seconds):
    x, v, step = 0.0, SPEED, 1 / HZ
    for count in range(int(seconds * HZ)):
        t = count * step
        time.sleep(max(0, start + t - time.time()))
        a = acceleration_at(t, brake_at)
        lat, lon = place(x)
        print(json.dumps({"utc": start + t, "lat": lat, "lon": lon, "velocity": v, "acceleration": a}), flush=True)
        x, v = x + v * step + a * step * step / 2, v + a * step


main(*map(float, sys.argv[1:4]))
