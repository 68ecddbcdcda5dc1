#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures how long it takes in joint command from data to decision, and to the answer, with the time of each step.

    decision_latency.py [--programs build/release/apps] [--runs 100] [--kbit 64] [--quick] [--from FILE] [--docs FOLDER]
                        [-o FILE]

A run is one strike, from a frame of the reconnaissance aircraft to the answer of the strike aircraft, in a scene of its own; a
script decides at once, and takes the part of the operator. Each role is on a host of its own: a network namespace, which requires
root. Runs by cable and runs whose mission centre has slow links take turns. Writes JSON: of each step, and of the sums, the
median over the runs, and of the sums the 99th percentile, with 95 % intervals. With --docs, also writes the figures and their
picture to docs/jadc2.md in that folder; with --from, what was measured earlier. Ends with 77 where there can be no namespaces.
"""

import argparse
import json
import os
import signal
import sys

from interval import interval_over, quantile, summary
from provenance import command, date, machine
from result_file import write

FOLDER = os.path.dirname(os.path.abspath(__file__))
sys.path += [os.path.join(FOLDER, "..", "..", "scripts"), os.path.join(FOLDER, "..")]
from jadc2_fleet import Fleet, Namespaces, Trouble  # noqa: E402
from report import pictures  # noqa: E402

NOTHING_TO_MEASURE = 77
CABLE, SLOW = "cable", "slow"
# The steps in their order; the sums are of all before them.
STEPS = {"encode_ms": "captured and encoded", "fmv_way_ms": "to the satellite and back", "fmv_queue_ms": "waited there",
         "fmv_run_ms": "processed there", "publish_ms": "published", "tracks_way_ms": "to the mission centre",
         "decide_ms": "decided", "data_to_decision_ms": "data to decision", "strike_way_ms": "to the strike aircraft and back",
         "strike_run_ms": "carried out there", "data_to_answer_ms": "data to answer"}
SUMS = ("data_to_decision_ms", "data_to_answer_ms")
PAGE, PICTURE = "jadc2.md", "jadc2_decision"
BEGIN, END = "<!-- decision_latency: begin -->", "<!-- decision_latency: end -->"


def strike(options, kbit, seed):
    """The times of one strike in the scene of that seed; None, if there was none."""
    with Fleet(options.programs, Namespaces(kbit)) as fleet:
        satellite, striker = fleet.satellite(seed=seed), fleet.striker(seed=seed)
        recon = fleet.recon([satellite], "--seed", str(seed))
        mission = fleet.mission(recon, [striker], "--duration", "20")
        mission.end()
        done = [each["data"] for each in mission.all("strike") if each["data"]["fate"] == "done"]
    return {"seed": seed, **{step: done[0][step] for step in STEPS}} if done else None


def measure(options):
    """{link: the times of each run}, and how many scenes of each link had no strike."""
    runs, without = {CABLE: [], SLOW: []}, {CABLE: 0, SLOW: 0}
    seeds = dict.fromkeys(runs, 0)
    for number in range(options.runs):
        for link in sorted(runs, reverse=number % 2 == 1):
            while len(runs[link]) == number:
                seeds[link] += 1
                found = strike(options, options.kbit if link == SLOW else None, seeds[link])
                if found:
                    runs[link].append(found)
                    continue
                without[link] += 1
                if without[link] > 3 + options.runs / 10:
                    raise SystemExit(f"decision_latency.py: {without[link]} runs without a strike ({link})")
        print(f"\rdata to decision: {number + 1} of {options.runs} runs", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return runs, without


def links(kbit):
    return {CABLE: "by cable", SLOW: f"with {kbit} kbit/s at the mission centre"}


def figure(name, what, value, low, high, runs):
    return {"name": name, "what": what, "value": value, "low": low, "high": high, "runs": runs, "unit": "ms", "paper": None,
            "target": None, "reached": None}


def late(values):
    return quantile(values, 0.99)


def figures(runs, texts):
    for link, all_runs in runs.items():
        for step, what in STEPS.items():
            values = [each[step] for each in all_runs]
            found = summary(values)
            yield figure(f"{link}_{step}", f"{what}, {texts[link]}, median", found["median"], found["low"], found["high"],
                         len(values))
            if step in SUMS:
                low, high = interval_over(values, late)
                yield figure(f"{link}_{step}_late", f"{what}, {texts[link]}, 99th percentile", late(values), low, high, len(values))


def measured(options):
    before = machine()  # before anything runs
    runs, without = measure(options)
    texts = links(options.kbit)
    return {"title": "From data to decision (sections 2.2 and 4.2)", "command": command("perf/evaluation/decision_latency.py"),
            "machine": before, "date": date(), "quick": options.quick, "kbit": options.kbit, "links": texts, "steps": STEPS,
            "figures": list(figures(runs, texts)), "without_strike": without, "runs": runs}


# --- The page --------------------------------------------------------------------------------------------------------------


def shown(each):
    value, low, high = (f"{ms:,.0f}" if ms >= 100 else f"{ms:.3g}" for ms in (each["value"], each["low"], each["high"]))
    return f"{value} ms ({low} to {high})"


def table(result):
    found = {each["name"]: each for each in result["figures"]}
    rows = [(STEPS[step] + of, step + suffix) for step in SUMS for of, suffix in ((", median", ""), (", 99 % of the runs within", "_late"))]
    rows += [(what + ", median", step) for step, what in STEPS.items() if step not in SUMS]
    head = ["| | " + " | ".join(result["links"].values()) + " |", "| --- |" + " --- |" * len(result["links"])]
    return [*head, *(f"| {what} | " + " | ".join(shown(found[f"{link}_{name}"]) for link in result["links"]) + " |"
                     for what, name in rows)]


def words(result):
    """What the page says, without the marks."""
    count = len(result["runs"][CABLE])
    picture = f"![Each step of each run, by cable and with {result['kbit']} kbit/s]({PICTURE}.svg)"
    return "\n".join([f"Measured on {pictures.note_of(result)}: {count} runs of each, with 95 % intervals in brackets.", "",
                      *table(result), "", picture])


def page_with(text, result):
    """The page with what was measured, instead of what was there between the marks."""
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        raise SystemExit(f"decision_latency.py: {PAGE} has no place for the figures: {BEGIN} and {END}")
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{words(result)}\n{END}{rest.split(END)[1]}"


def publish(result, folder):
    drawn = next(each for each in pictures.pictures_of("decision_latency", result) if each.name == PICTURE)
    if drawn.missing:
        raise SystemExit(f"decision_latency.py: no picture: {drawn.missing}")
    page = os.path.join(folder, PAGE)
    with open(page, encoding="utf-8") as file:
        text = page_with(file.read(), result)
    with open(os.path.join(folder, PICTURE + ".svg"), "w", encoding="utf-8") as file:
        file.write(drawn.svg)
    with open(page, "w", encoding="utf-8") as file:
        file.write(text)


def main():
    parser = argparse.ArgumentParser(description="Measures how long it takes from data to decision, and to the answer.")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--runs", type=int, default=100, help="strikes over each link")
    parser.add_argument("--kbit", type=int, default=64, help="kilobits per second of the slow links")
    parser.add_argument("--quick", action="store_true", help="2 runs over each link: shows that it works, not how fast")
    parser.add_argument("--from", dest="source", metavar="FILE", help="measure nothing: take the JSON of an earlier measurement")
    parser.add_argument("--docs", metavar="FOLDER", help=f"also write the figures to {PAGE} in this folder, with their picture")
    parser.add_argument("-o", "--output", default="-")
    options = parser.parse_args()
    if options.runs < 1 or options.kbit < 8:
        parser.error("--runs: at least one; --kbit: at least 8")
    if options.quick and options.docs:
        parser.error("--docs: not what a quick run has measured")
    if options.quick:
        options.runs = 2
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what it started is ended
    if options.source:
        with open(options.source, encoding="utf-8") as file:
            result = json.load(file)
        if result.get("quick") and options.docs:
            parser.error("--docs: not what a quick run has measured")
    else:
        try:
            Namespaces(options.kbit).close()
        except Trouble as no_way:
            print(f"decision_latency.py: {' '.join(str(no_way).split())}", file=sys.stderr)
            return NOTHING_TO_MEASURE
        try:
            result = measured(options)
        except Trouble as trouble:
            raise SystemExit(f"decision_latency.py: {trouble}") from None
        write(result, options.output)
    if options.docs:
        publish(result, options.docs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
