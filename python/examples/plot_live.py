#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Plots a number of the updates of a noun in the terminal.

    plot_live.py thermo:temperature celsius --at tcp://127.0.0.1:25373
"""

import argparse
import asyncio
import shutil
import sys
from collections import deque

import cles

BARS = " ▁▂▃▄▅▆▇█"


def plot(values: list[float], width: int, height: int) -> list[str]:
    """Lines of the last values, one column for each."""
    shown = values[-width:]
    low, high = min(shown), max(shown)
    span = high - low or 1.0
    levels = [(value - low) / span * (height * 8 - 1) + 1 for value in shown]
    rows = []
    for row in reversed(range(height)):
        rows.append("".join(BARS[max(0, min(8, int(level - row * 8)))] for level in levels))
    return rows


def number_of(value: object, member: str | None) -> float | None:
    if isinstance(value, dict):
        value = value.get(member) if member else next((v for v in value.values() if isinstance(v, (int, float))), None)
    return float(value) if isinstance(value, (int, float)) else None


async def main(noun: str, member: str | None, at: str, count: int) -> None:
    values: deque[float] = deque(maxlen=1000)
    is_terminal = sys.stdout.isatty()
    async with cles.connect(at) as node, node.bind(noun, every=0.05) as feed:
        async for update in feed:
            number = number_of(update.value, member)
            if number is None:
                continue
            values.append(number)
            size = shutil.get_terminal_size((72, 16))
            rows = plot(list(values), size.columns - 1, max(size.lines - 3, 4))
            head = f"{noun} {member or ''}  now {number:g}  lowest {min(values):g}  highest {max(values):g}"
            print(("\x1b[H\x1b[2J" if is_terminal else "") + "\n".join([head, *rows]), flush=True)
            count -= 1
            if count == 0:
                return


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("noun")
    parser.add_argument("member", nargs="?", help="of the updates; by default, the first that is a number")
    parser.add_argument("--at", default="tcp://127.0.0.1:25370", metavar="URL")
    parser.add_argument("-n", "--count", type=int, default=0, help="end after so many updates; 0: never")
    given = parser.parse_args()
    try:
        asyncio.run(main(given.noun, given.member, given.at, given.count))
    except KeyboardInterrupt:
        pass
    except cles.Error as error:
        sys.exit(f"plot_live: {error}")
