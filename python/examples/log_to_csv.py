#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Writes the updates of a noun as lines of CSV, until it is interrupted, or as many as stated.

    log_to_csv.py thermo:temperature --at tcp://127.0.0.1:25373 > temperature.csv
"""

import argparse
import asyncio
import csv
import sys
import time

import cles


async def main(noun: str, at: str, count: int, every: float | None) -> None:
    table = csv.writer(sys.stdout, lineterminator="\n")
    columns: list[str] = []

    def lost(why: str) -> None:
        print(f"lost: {why}", file=sys.stderr)

    async with cles.connect(at) as node, node.bind(noun, every=every, lost=lost) as feed:
        async for update in feed:
            value = update.value if isinstance(update.value, dict) else {"value": update.value}
            if not columns:
                columns = list(value)
                table.writerow(["received", "seq", "missed", *columns])
            table.writerow([f"{time.time():.3f}", update.seq, update.missed, *(value.get(name, "") for name in columns)])
            sys.stdout.flush()
            count -= 1
            if count == 0:
                return


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("noun")
    parser.add_argument("--at", default="tcp://127.0.0.1:25370", metavar="URL")
    parser.add_argument("-n", "--count", type=int, default=0, help="end after so many; 0: never")
    parser.add_argument("--every", type=float, metavar="SECONDS", help="at most one update in this time")
    given = parser.parse_args()
    try:
        asyncio.run(main(given.noun, given.at, given.count, given.every))
    except KeyboardInterrupt:
        pass
    except cles.Error as error:
        sys.exit(f"log_to_csv: {error}")
