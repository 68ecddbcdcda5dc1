#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures latency, packet size and effort as the paper's section 4.1 and Fig. 3 do: PULL, and BIND with UPDATE, against
the same exchange by hand.

    latency.py [--programs build/release/apps] [--runs 15] [--rounds 10] [--quick] [-o FILE]

Writes JSON. On loopback it runs `cles bench`, as fast as it goes, and `cles_link_latency`, 1000 and 50 times a second; the
latter between two network namespaces too, which require root: on a cable, on a link like a WiFi's, and on one of 64 kbit/s.
Updates go by TCP and by multicast. Exchanges take turns within each round, so that other load on the machine affects
all of them. Each figure is over all rounds, its interval of 95 % over resampled rounds.
"""

import argparse
import contextlib
import json
import os
import signal
import statistics
import subprocess
import sys
from pathlib import Path

from clean_environment import clean_environment
from interval import interval_over, quantile
from linked_hosts import WIFI, LinkedHosts, OneHost, why_not
from packet_values import ROUNDED, UNROUNDED
from provenance import command, date, machine
from result_file import write

COUNT_LINES = Path(__file__).parent.parent / "effort" / "count_lines.py"
WANTED_RATIO, WANTED_ONE_WAY, WANTED_BYTES, WANTED_LINES = 1.10, 0.6, 132, 30
PAPER_OVERHEAD_US, PAPER_BYTES, PAPER_BYTES_RATIO, PAPER_LINES, PAPER_LINES_RATIO = 1500, 132, 3, 30, 10

# Name, description, arguments of the relay (empty: a cable; None: one host), milliseconds between exchanges.
LINKS = [
    ("lively", "on loopback, 1000 a second", None, 1),
    ("paced", "on loopback, 50 a second", None, 20),
    ("cable", "between namespaces, by a virtual cable", [], 20),
    ("wifi", "like WiFi: 1.5 ms each way, jitter of 1 ms on average, 1 % lost",
     list(WIFI), 20),
    ("narrow", "64 kbit/s, 5 ms each way", ["--rate", "64", "--delay", "5"], 100),
]
KINDS = {"icd-pull": "round trip by hand", "pull": "PULL", "icd-update": "one way by hand",
         "update": "UPDATE, one way", "update-multicast": "UPDATE by multicast, one way, of those received"}
BOTH = "by hand a packed struct over TCP by blocking sockets; CLES over TCP, without polling; each end on a core of its own"


class Figures:
    def __init__(self):
        self.found = []

    def add(self, name, what, value, unit, interval=None, paper=None, target=None, at_most=None, ran=None):
        low, high = interval or (value, value)
        self.found.append({"name": name, "what": what, "ran": ran, "value": rounded(value), "low": rounded(low),
                           "high": rounded(high), "unit": unit, "paper": paper,
                           "target": target or (f"<= {at_most:g}" if at_most is not None else None),
                           "reached": value <= at_most if at_most is not None else None})

    def over(self, rounds, name, what, unit, statistic, **more):
        self.add(name, what, statistic(rounds), unit, interval_over(rounds, statistic), **more)


def rounded(value):
    return float(f"{value:.5g}") if isinstance(value, float) else value


def run(words, **options):
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=900, check=False,
                          **options)
    if done.returncode != 0:
        raise SystemExit(f"latency.py: {' '.join(map(str, words))} ended with {done.returncode}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def bench(programs, *words):
    return run([os.path.join(programs, "cles"), "bench", *words, "-o", "json"], env=clean_environment())


# --- Loopback ----------------------------------------------------------------------------------------------------------


def loopback_rounds(programs, runs, requests, updates):
    rounds = []
    for turn in range(runs):
        pulls = bench(programs, "--rounds", "1", "--requests", str(requests))
        row, by_group = (bench(programs, "--fan-out", "--transport", carrier, "--binders", "1", "--rounds", "1", "--requests",
                               str(updates))["rows"][0] for carrier in ("tcp", "multicast"))
        rounds.append({"icd-pull": pulls["icd"], "pull": pulls["cles"], "icd-update": row["icd"]["paced"]["latency"],
                       "update": row["cles"]["paced"]["latency"],
                       "update-multicast": by_group["cles"]["paced"]["latency"]})
        progress("loopback", turn + 1, runs)
    return rounds


def loopback_figures(figures, rounds):
    def typical(kind, key):
        return lambda some: statistics.median(one[kind][key] for one in some)

    add_latencies(figures, rounds, "loopback", "on loopback",
                  {"p50": lambda kind: typical(kind, "p50_us"), "p99": lambda kind: typical(kind, "p99_us")},
                  {"pull": f"both far ends only answer, one request after the other; {BOTH}",
                   "update": f"both publish every millisecond to one subscriber; {BOTH}"}, at_most=WANTED_RATIO)


# --- Links -------------------------------------------------------------------------------------------------------------


class Link:
    """The processes of one condition."""

    def __init__(self, programs, words, interval_ms):
        perf = os.path.abspath(os.path.join(programs, "..", "perf"))
        self.timing = os.path.join(perf, "links", "cles_link_latency")
        relay = os.path.join(perf, "links", "cles_link_relay")
        self.hosts = OneHost() if words is None else LinkedHosts(relay if words else None, words)
        self.pace = ["--interval", str(interval_ms)]

    def round(self, count, turn):
        """Microseconds of all kinds in turn, beginning with another one each time."""
        kinds, at = list(KINDS), turn % len(KINDS)
        return {kind: self.timed(kind, count) for kind in kinds[at:] + kinds[:at]}

    def timed(self, kind, count):
        """Runs the far end only meanwhile, because its publications would wake a core during the others' turns."""
        words = ["update", "--multicast", self.hosts.groups["far"]] if kind == "update-multicast" else [kind]
        with self.hosts.running("far", self.timing, "serve", *words, f"tcp://{self.hosts.addresses['far']}:0",
                                *self.pace) as url:
            where = self.hosts.groups["near"] if kind == "update-multicast" else url
            return run(self.hosts.command("near", self.timing, "time", kind, where, "--count", str(count), *self.pace))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.hosts.close()


def link_rounds(programs, possible, rounds, count):
    found = {name: [] for name, *_ in possible}
    with contextlib.ExitStack() as stack:
        links = {name: stack.enter_context(Link(programs, words, interval)) for name, _, words, interval in possible}
        for turn in range(rounds):
            for name, link in links.items():
                found[name].append(link.round(count, turn))
            progress("links", turn + 1, rounds)
    return found


def link_figures(figures, found):
    def pooled(kind, share):
        return lambda some: quantile([us for one in some for us in one[kind]], share)

    for name, meaning, _, interval_ms in LINKS:
        if name in found:
            of = {"p50": lambda kind: pooled(kind, 0.5), "p99": lambda kind: pooled(kind, 0.99)}
            ran = {"pull": f"both far ends only answer, one request every {interval_ms} ms, and sleep in between; {BOTH}",
                   "update": f"both far ends publish every {interval_ms} ms to one subscriber; {BOTH}"}
            add_latencies(figures, found[name], name, meaning, of, ran)
            add_one_way(figures, found[name], name, meaning, of,
                        f"both by CLES every {interval_ms} ms: a far end that only publishes, and one that only answers; "
                        "without polling; each end on a core of its own")


def add_latencies(figures, rounds, name, meaning, statistics_of, ran, at_most=None):
    """Adds each exchange, what CLES adds to the hand-written one, and their ratio. `ran` tells what both did."""
    p50 = statistics_of["p50"]
    figures.over(rounds, f"{name}_pull_overhead", f"what CLES adds to a round trip, {meaning}, p50", "us",
                 lambda some: p50("pull")(some) - p50("icd-pull")(some), paper=PAPER_OVERHEAD_US, at_most=PAPER_OVERHEAD_US)
    for key, of in statistics_of.items():
        for kind, what in KINDS.items():
            figures.over(rounds, f"{name}_{kind.replace('-', '_')}_{key}", f"{what}, {meaning}, {key}", "us", of(kind))

        def ratio(above, below, of=of):
            return lambda some: of(above)(some) / of(below)(some)

        wanted = {"at_most": at_most} if key == "p50" else {}
        figures.over(rounds, f"{name}_pull_ratio_{key}", f"PULL to by hand, {meaning}, {key}", "times",
                     ratio("pull", "icd-pull"), ran=ran["pull"], **wanted)
        figures.over(rounds, f"{name}_update_ratio_{key}", f"UPDATE to by hand, {meaning}, {key}", "times",
                     ratio("update", "icd-update"), ran=ran["update"])


def add_one_way(figures, rounds, name, meaning, statistics_of, ran):
    """Only if both have the same pace, because cores that sleep longer take longer to wake."""
    for key, of in statistics_of.items():
        wanted = {"at_most": WANTED_ONE_WAY} if key == "p50" else {}
        for kind, what in (("update", "UPDATE one way"), ("update-multicast", "UPDATE by multicast one way")):
            figures.over(rounds, f"{name}_{kind.replace('-', '_')}_to_pull_{key}",
                         f"{what} to PULL's round trip, {meaning}, {key}", "times",
                         lambda some, of=of, kind=kind: of(kind)(some) / of("pull")(some), ran=ran, **wanted)


# --- Bytes and lines ---------------------------------------------------------------------------------------------------


def add_sizes(figures, programs):
    add_bytes(figures, {row["message"]: row for row in bench(programs, "--bytes")["rows"]})


def add_bytes(figures, rows):
    """The paper counts the reply alone: 132 bytes are three times the 44 of its struct."""
    by_hand = {"reply": rows["PULL reply"]["icd_tcp"]["bytes"], "pull": pull_bytes(rows, "icd_tcp")}
    for part, what in (("reply", "the reply"), ("pull", "request and reply")):
        figures.add(f"icd_{part}_bytes", f"{what} by hand, a struct, by TCP, without its headers", by_hand[part], "bytes")
    for prefix, way, values, wanted_bytes, wanted_ratio in (("", "tcp", ROUNDED, WANTED_BYTES, PAPER_BYTES_RATIO),
                                                            ("unrounded_", "unrounded_tcp", UNROUNDED, None, None)):
        ran = f"by hand a struct with doubles; CLES text, {values}; both without the headers of TCP"
        reply, pull = rows["PULL reply"][way]["bytes"], pull_bytes(rows, way)
        figures.add(f"{prefix}reply_bytes", f"PULL, the reply by TCP, without its headers, {values}", reply, "bytes",
                    paper=PAPER_BYTES, at_most=wanted_bytes)
        figures.add(f"{prefix}reply_bytes_ratio", f"that reply to the one by hand, bytes, {values}", reply / by_hand["reply"],
                    "times", paper=PAPER_BYTES_RATIO, at_most=wanted_ratio, ran=ran)
        figures.add(f"{prefix}pull_bytes", f"PULL, request and reply by TCP, without its headers, {values}", pull, "bytes")
        figures.add(f"{prefix}pull_bytes_ratio", f"request and reply to those by hand, bytes, {values}",
                    pull / by_hand["pull"], "times", ran=ran)


def pull_bytes(rows, way):
    return sum(rows[f"PULL {part}"][way]["bytes"] for part in ("request", "reply"))


def add_lines(figures):
    counts = run([sys.executable, "-B", str(COUNT_LINES), "--json"])
    ours, by_hand = (counts[f"{way}_localization.cpp"] for way in ("cles", "icd"))
    figures.add("cles_lines", "source lines of client and server by CLES, includes not counted", ours["lines"], "lines",
                paper=PAPER_LINES, at_most=WANTED_LINES)
    figures.add("icd_lines", "the same by hand", by_hand["lines"], "lines", paper=PAPER_LINES * PAPER_LINES_RATIO)
    figures.add("lines_ratio", "by hand to CLES, source lines", by_hand["lines"] / ours["lines"], "times",
                paper=PAPER_LINES_RATIO,
                ran="two whole programs that pass the same test: server and client, command line, errors")
    figures.add("cles_lines_all", "source lines by CLES with includes", sum(ours.values()), "lines", paper=PAPER_LINES)
    figures.add("icd_lines_all", "the same by hand", sum(by_hand.values()), "lines", paper=PAPER_LINES * PAPER_LINES_RATIO)
    figures.add("lines_ratio_all", "by hand to CLES, source lines with includes", sum(by_hand.values()) / sum(ours.values()),
                "times", paper=PAPER_LINES_RATIO, ran="the same two programs")


# --- The result --------------------------------------------------------------------------------------------------------


def progress(what, done, of):
    print(f"\rlatency: {what}, {done} of {of}", end="\n" if done == of else "", file=sys.stderr, flush=True)


def series_of(loopback, links):
    """The raw values: the quantiles of each run on loopback, every latency across links."""
    series = {"loopback": {f"{kind}_{key}": [one[kind][key] for one in loopback]
                           for kind in KINDS for key in ("p50_us", "p99_us")}}
    for name, rounds in links.items():
        series[name] = {kind: [[round(us, 1) for us in one[kind]] for one in rounds] for kind in KINDS}
    return series


def main():
    parser = argparse.ArgumentParser(description="Measures latency, packet size and effort (the paper's section 4.1).")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--runs", type=int, default=15, help="of each exchange on loopback")
    parser.add_argument("--requests", type=int, default=20_000, help="PULLs in a run on loopback; a twentieth of updates")
    parser.add_argument("--rounds", type=int, default=10, help="of each exchange on each link")
    parser.add_argument("--count", type=int, default=100, help="of each exchange in a round on a link")
    parser.add_argument("--quick", action="store_true", help="3 short runs: shows that it works, not how fast")
    parser.add_argument("-o", "--output", default="-")
    options = parser.parse_args()
    if options.quick:
        options.runs, options.requests, options.rounds, options.count = 3, 400, 3, 8
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what it started is ended
    before = machine()  # before anything runs
    figures, skipped, possible = Figures(), [], LINKS
    loopback = loopback_rounds(options.programs, options.runs, options.requests, max(1, options.requests // 20))
    loopback_figures(figures, loopback)
    reason = why_not()
    if reason:
        possible = [link for link in LINKS if link[2] is None]
        skipped.append(f"two hosts with a link between them: {reason}")
        print(f"latency.py: skipped {skipped[-1]}", file=sys.stderr)
    links = link_rounds(options.programs, possible, options.rounds, options.count)
    link_figures(figures, links)
    add_sizes(figures, options.programs)
    add_lines(figures)
    result = {"title": "Latency, packet size and effort (section 4.1, Fig. 3)",
              "command": command("perf/evaluation/latency.py"), "machine": before, "date": date(),
              "quick": options.quick, "skipped": skipped,
              "links": {name: meaning for name, meaning, *_ in LINKS if name in links},
              "figures": figures.found, "series": series_of(loopback, links)}
    write(result, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
