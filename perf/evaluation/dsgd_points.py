# SPDX-License-Identifier: BSL-1.0
"""The data set of distributed stochastic gradient descent, made a second time: what plugins/sgd makes in C++, here from its
description alone (docs/dsgd.md). So its pictures need no way to get at the points, and the error that the manager reports
is found once more by a program that shares no line with it."""

import math

SEPARATION, PER_CLASS, SEED = 7, 100_000, 1
SHOWN = 2_000  # points in the picture of all
BOX = 1.0      # half the side of the zoomed picture, about the middle between the classes
ALL_BITS = (1 << 64) - 1


def _splitmix64(state):
    while True:
        state = (state + 0x9e3779b97f4a7c15) & ALL_BITS
        z = ((state ^ (state >> 30)) * 0xbf58476d1ce4e5b9) & ALL_BITS
        z = ((z ^ (z >> 27)) * 0x94d049bb133111eb) & ALL_BITS
        yield z ^ (z >> 31)


def made(seed=SEED, per_class=PER_CLASS, separation=SEPARATION):
    """(x, y) of every point; those with even indices are of class 0."""
    chance = _splitmix64(seed)
    mean = separation / 2 / math.sqrt(2)
    points = []
    while len(points) < 2 * per_class:
        u = (next(chance) >> 11) * 2.0 ** -52 - 1
        v = (next(chance) >> 11) * 2.0 ** -52 - 1
        s = u * u + v * v
        if 0 < s < 1:
            scale = math.sqrt(-2 * math.log(s) / s)
            centre = mean if len(points) % 2 else -mean
            points.append((centre + u * scale, centre + v * scale))
    return points


def mean_squared_error(points, classifier):
    """The error of {"weights": [a, b], "bias": c}."""
    (a, b), c = classifier["weights"], classifier["bias"]
    return math.fsum((a * x + b * y + c - place % 2) ** 2 for place, (x, y) in enumerate(points)) / len(points)


def pictured(points, classifier):
    """The points to draw: an even sample of all, and all near the boundary between the classes."""
    step = max(1, len(points) // SHOWN) | 1  # odd, so that it alternates between the classes
    some = [(round(x, 3), round(y, 3), place % 2) for place, (x, y) in list(enumerate(points))[::step]]
    near = [(round(x, 4), round(y, 4), place % 2) for place, (x, y) in enumerate(points) if abs(x) < BOX and abs(y) < BOX]
    return {"of": len(points), "some": some, "near": near, "box": BOX, "classifier": classifier}
