#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures CLES and other middleware beside the hand-written exchange: the same packet asked for, an empty task, one
publisher and many subscribers.

    peers.py [--programs build/release/perf/peers] [--rounds 5] [--only NAME,...] [--spread] [--awake] [--quick] [-o FILE]

Prints a table of ratios and the versions and, with -o, writes JSON. All take turns, round by round, so that whatever else
the machine does falls on all of them. Peers that are not installed or built are named with the reason. Ends with 1 where
one that is there fails.
"""

import argparse
import contextlib
import json
import os
import signal
import struct
import subprocess
import sys

from peers_rows import MEASURES, PEERS, rows_of, table_of
from provenance import command, date, machine
from result_file import write

NOT_OFFERED = 77
LONGEST_RUN_S = 300


class Failure(Exception):
    """A program exists, but failed."""


@contextlib.contextmanager
def cores_awake():
    """While it lasts, the system lets no core sleep, whatever runs on it (PM Quality of Service of the kernel)."""
    with open("/dev/cpu_dma_latency", "wb", buffering=0) as limit:
        limit.write(struct.pack("i", 0))
        yield


def program_of(folder, peer):
    return os.path.join(folder, f"cles_peer_{peer}")


def run_program(folder, peer, arguments):
    """Its report, or the reason as text if it does not offer this."""
    try:
        done = subprocess.run([program_of(folder, peer), *arguments], stdin=subprocess.DEVNULL, capture_output=True,
                              text=True, check=False, timeout=LONGEST_RUN_S)
    except subprocess.TimeoutExpired:
        raise Failure(f"{' '.join(arguments)} took longer than {LONGEST_RUN_S} s") from None
    words = done.stderr.strip().removeprefix("cles_peer: ").removeprefix("not offered: ")
    if done.returncode == NOT_OFFERED:
        return words
    if done.returncode != 0:
        raise Failure(f"{' '.join(arguments)} ended with {done.returncode}: {words}")
    return json.loads(done.stdout)


def present_peers(folder, only):
    """Those whose program exists, and [{"name", "reason"}] of the others."""
    present, skipped = [], []
    reasons = {}
    listed = os.path.join(folder, "skipped.json")
    if os.path.exists(listed):
        with open(listed, encoding="utf-8") as file:
            reasons = json.load(file)
    for peer, carriers in PEERS:
        if only and peer not in only:
            skipped.append({"name": peer, "reason": "not asked for"})
        elif os.access(program_of(folder, peer), os.X_OK):
            present.append((peer, carriers))
        else:
            skipped.append({"name": peer, "reason": reasons.get(peer, "its program is not built")})
    return present, skipped


def measure(folder, present, skipped, options):
    about, runs, failed = {}, {}, set()

    def attempt(peer, arguments):
        try:
            return run_program(folder, peer, arguments)
        except Failure as failure:
            failed.add(peer)
            skipped.append({"name": peer, "reason": f"failed: {failure}"})
            print(f"\npeers: {peer}: {failure}", file=sys.stderr)
            return None

    for peer, _ in present:
        about[peer] = attempt(peer, ["--about"])
        if isinstance(about[peer], str):
            failed.add(peer)
            skipped.append({"name": peer, "reason": about[peer]})
    places = [(peer, over) for peer, carriers in present for over in carriers]
    for turn in range(options.rounds):
        for name, (arguments, counts) in MEASURES.items():
            for at in range(len(places)):
                peer, over = places[(at + turn) % len(places)]
                if peer in failed or isinstance(runs.get((peer, over, name)), str):
                    continue
                print(f"\rpeers: round {turn + 1} of {options.rounds}, {name}, {peer} {over}".ljust(72), end="",
                      file=sys.stderr, flush=True)
                said = attempt(peer, [*arguments, "--over", over, "--count", str(counts[1 if options.quick else 0]),
                                      *(["--spread"] if options.spread else [])])
                if isinstance(said, str):
                    runs[peer, over, name] = said
                elif said is not None:
                    runs.setdefault((peer, over, name), []).append(said)
    print(file=sys.stderr)
    # In the order of the rows, not of the turns. What failed has no row.
    return {(peer, over, name): runs[peer, over, name] for peer, over in places for name in MEASURES
            if peer not in failed and (peer, over, name) in runs}, about, failed


def main():
    parser = argparse.ArgumentParser(description="Measures CLES and other middleware beside the hand-written exchange.")
    parser.add_argument("--programs", default="build/release/perf/peers")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", type=lambda text: text.split(","), default=[], help="these peers, separated by commas")
    parser.add_argument("--spread", action="store_true", help="let all ends run on all cores, instead of one core each")
    parser.add_argument("--awake", action="store_true", help="let no core sleep meanwhile; requires root")
    parser.add_argument("--quick", action="store_true", help="one short round: shows that it works, not how fast")
    parser.add_argument("-o", "--output", help="write JSON there; - is the standard output, and no table then")
    options = parser.parse_args()
    unknown = set(options.only) - {peer for peer, _ in PEERS}
    if unknown or options.rounds < 1:
        parser.error(f"no such peer: {', '.join(sorted(unknown))}" if unknown else "--rounds takes 1 or more")
    if options.quick:
        options.rounds = 1
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what it started is ended
    present, skipped = present_peers(options.programs, options.only)
    if not present:
        print(f"peers.py: {options.programs} holds no peer's program; build with CLES_BUILD_PEERS=ON, and see --programs",
              file=sys.stderr)
        return 77
    before = machine()  # before anything runs
    try:
        with cores_awake() if options.awake else contextlib.nullcontext():
            runs, about, failed = measure(options.programs, present, skipped, options)
    except OSError as error:
        if error.filename != "/dev/cpu_dma_latency":
            raise
        print(f"peers.py: cannot keep the cores awake: {error}", file=sys.stderr)
        return 2
    rows = rows_of(runs, about)
    result = {"title": "CLES beside other middleware, in ratios to a hand-written exchange over TCP"
                       + (", with cores kept awake" if options.awake else ""),
              "command": command("perf/evaluation/peers.py"), "machine": before, "date": date(),
              "rounds": options.rounds, "quick": options.quick, "spread": options.spread, "awake": options.awake,
              "skipped": skipped, "rows": rows}
    if options.output != "-":
        print("\n".join(table_of(rows)))
        for peer, said in about.items():
            if isinstance(said, dict):
                print(f"{peer}: {said['version']}; {said['settings']}")
        for each in skipped:
            print(f"without {each['name']}: {each['reason']}")
    if options.output:
        write(result, options.output)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
