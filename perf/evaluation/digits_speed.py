#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures distributed descent on handwritten digits (docs/dsgd.md, "Rounds"): two nodes of a core each, each of which passes
once over its own files in a round, against one node of one core that has all files, and against one thread without CLES.

    python3 perf/evaluation/digits_speed.py [--programs build/release/apps] [--from FILE | --download | --drawn]
                                            [--seeds 20] [--rounds 60] [--hidden 64] [--quick] [-o FILE] [--picture FILE]

All use the same split of the digits. The size of a step is searched alike for each: of the same sizes, with the same seeds,
which are not those of the measurement, the one that reaches 97 % after the fewest rounds. Then each seed runs with all of them
in turn. Writes the figures, with the 95 % intervals of the medians, as JSON; --picture draws the accuracy over time. Ends with
1 if the target was not reached, except with --quick, which shows that it works, not how fast. For meaningful figures, run
nothing else. Without an option that says which, the digits are those of the installed package, or of the package without
installing it; with --quick, drawn ones. Ends with 77 if there are none."""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from clean_environment import clean_environment
from interval import summary
from provenance import command, date, machine
from result_file import write

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "perf"))
from report import gnuplot, pictures  # noqa: E402

RATES = (0.0125, 0.025, 0.05, 0.1, 0.2)
SEARCH_SEEDS = (1001, 1002, 1003, 1004, 1005)
WANTED_ACCURACY = 0.97
WANTED_RATIO = 1.5
NOTHING_TO_MEASURE = 77
INSTALLED = "/usr/lib/python3/dist-packages/sklearn/datasets/data/digits.csv.gz"
RAN = "each with a core of its own; the same files, one pass over them a round, the accuracy measured at the end only"
SIDES = {"thread": "one thread, without CLES", "one": "one node", "two": "two nodes", "non_iid": "two nodes, each with few classes"}


class Daemon:
    """A node with one worker, on one core."""

    def __init__(self, programs, name, core, files, seeds, folder):
        plugin = os.path.abspath(os.path.join(programs, "..", "plugins", "libcles-digits.so"))
        config = Path(folder) / f"{name}.yaml"
        config.write_text(f"node: {name}\nlisten: [tcp://127.0.0.1:0]\nmulticast: off\nworkers: 1\n"
                          f"plugins: [{{path: {plugin}, config: {{files: [{', '.join(map(str, files))}]}}}}]\n"
                          + (f"seeds: [{', '.join(seeds)}]\n" if seeds else ""), encoding="utf-8")
        with open(Path(folder) / f"{name}.log", "w", encoding="utf-8") as log:
            self.process = subprocess.Popen(["taskset", "--cpu-list", str(core), os.path.join(programs, "clesd"), "--config",
                                             str(config)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log,
                                            text=True, env=clean_environment())
        line = self.process.stdout.readline()
        if " listening on " not in line:
            self.stop()
            raise SystemExit(f"digits_speed.py: {name} did not start: {(Path(folder) / f'{name}.log').read_text()}")
        self.url = line.split()[-1]

    def stop(self):
        self.process.terminate()
        self.process.communicate()


class NoDigits(Exception):
    pass


class Laboratory:
    """The files, the daemons, and how each side is run."""

    def __init__(self, options, folder):
        self.options, self.folder, self.daemons = options, Path(folder), {}
        source = ["--drawn", "1000"] if options.drawn else ["--download"] if options.download else (
            ["--from", options.source] if options.source else [])
        for name, more in (("iid", []), ("non_iid", ["--non-iid"])):
            made = subprocess.run([sys.executable, "-B", str(ROOT / "scripts" / "digits"), str(self.folder / name), "--workers", "2",
                                   *source, *more], check=False, stdout=subprocess.DEVNULL)
            if made.returncode != 0:
                raise NoDigits
        cores = sorted(os.sched_getaffinity(0))
        self.cores = {"first": cores[0], "second": cores[-1]}
        self.files = [self.folder / "iid" / f"worker{k}.csv" for k in (1, 2)]
        self.test = self.folder / "iid" / "test.csv"  # of both divisions the same
        few = [self.folder / "non_iid" / f"worker{k}.csv" for k in (1, 2)]
        for name, core, files in (("one", "first", self.files), ("two1", "first", self.files[:1]), ("two2", "second", self.files[1:]),
                                  ("few1", "first", few[:1]), ("few2", "second", few[1:])):
            seeds = [self.daemons["one"].url] if self.daemons else []
            self.daemons[name] = Daemon(options.programs, name, self.cores[core], files, seeds, folder)

    def arguments_of(self, side):
        if side == "thread":
            return ["--local", ",".join(map(str, self.files))]
        nodes = {"one": "one", "two": "two1,two2", "non_iid": "few1,few2"}[side]
        return ["--at", self.daemons["one"].url, "--nodes", nodes]

    def run(self, side, rate, seed, rounds, evaluate):
        words = [os.path.join(self.options.programs, "cles-dsgd"), "rounds", *self.arguments_of(side), "--test", str(self.test),
                 "--rounds", str(rounds), "--rate", str(rate), "--seed", str(seed), "--hidden", str(self.options.hidden),
                 "--evaluate", str(evaluate), "--json"]
        if side == "thread":
            words = ["taskset", "--cpu-list", str(self.cores["first"]), *words]
        done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=600, check=False,
                              env=clean_environment())
        if done.returncode not in (0, 7):  # 7: the result is not good, which the figures show
            raise SystemExit(f"digits_speed.py: {' '.join(words)} ended with {done.returncode}: {done.stderr}")
        return json.loads(done.stdout)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for daemon in self.daemons.values():
            daemon.stop()


def reached(report):
    """(round, ms) at which the accuracy was reached first; None if it never was."""
    return next(((each["round"], each["after_ms"]) for each in report["accuracies"] if each["accuracy"] >= WANTED_ACCURACY), None)


def searched_rate(laboratory, side, rounds, seeds):
    """The size of a step that needs the fewest rounds; of those that need as many, the one with the best end."""
    def badness(rate):
        found = [laboratory.run(side, rate, seed, rounds, 1) for seed in seeds]
        needed = [(reached(each) or (rounds + 1,))[0] for each in found]
        return statistics.median(needed), -statistics.median(each["accuracy"] for each in found)

    return min(RATES, key=badness)


def figure(name, what, values, unit, target=None, is_reached=None, ran=None):
    found = summary(list(values))
    return {"name": name, "what": what, "ran": ran, "value": found["median"], "low": found["low"], "high": found["high"],
            "runs": found["runs"], "unit": unit, "target": target, "reached": is_reached(found["median"]) if is_reached else None}


def figures_of(speeds, courses, rounds):
    yield figure("speed_up_nodes", "images per second of two nodes, to those of one node",
                 [two / one for two, one in zip(speeds["two"], speeds["one"])], "times", f"\u2265 {WANTED_RATIO}",
                 lambda found: found >= WANTED_RATIO, ran=f"two nodes and one, {RAN}")
    yield figure("speed_up_thread", "images per second of two nodes, to those of one thread without CLES",
                 [two / one for two, one in zip(speeds["two"], speeds["thread"])], "times",
                 ran=f"two nodes and one thread, {RAN}")
    for side, what in SIDES.items():
        yield figure(f"images_per_s_{side}", f"{what}: images per second", speeds[side], "1/s")
        times = [found[1] for found in map(reached, courses[side]) if found]
        yield {"name": f"reached_{side}", "what": f"{what}: seeds of {len(courses[side])} that reach {WANTED_ACCURACY:.0%} within "
               f"{rounds} rounds", "value": len(times), "unit": ""}
        if times:
            yield figure(f"time_{side}", f"{what}: time to {WANTED_ACCURACY:.0%}, of those that reach it", times, "ms")
        yield figure(f"accuracy_{side}", f"{what}: accuracy after {rounds} rounds", [each["accuracy"] for each in courses[side]], "")
        if side != "thread":
            yield figure(f"bytes_{side}", f"{what}: bytes that the manager sends and receives in a round",
                         [each["bytes_per_round"] for each in courses[side]], "bytes")


def curves_of(courses):
    """{side: [(median ms, median, lowest and highest quarter of the accuracy)]}, a point for each round."""
    curves = {}
    for side, reports in courses.items():
        rounds = zip(*([(each["after_ms"], each["accuracy"]) for each in report["accuracies"]] for report in reports))
        curves[side] = []
        for found in rounds:
            accuracies = sorted(accuracy for _, accuracy in found)
            quarter = len(accuracies) // 4
            curves[side].append((statistics.median(ms for ms, _ in found), statistics.median(accuracies), accuracies[quarter],
                                 accuracies[-1 - quarter]))
    return curves


def lines_of(curves):
    return {SIDES[side]: [[ms, accuracy * 100] for ms, accuracy, _, _ in points] for side, points in curves.items()}


def picture_of(result):
    data, parts = [], []
    for place, (side, points) in enumerate(result["curves"].items()):
        data.append(gnuplot.block(side, [(ms, accuracy * 100) for ms, accuracy, _, _ in points]))
        title = f"{SIDES[side]}, step {result['rates'][side]:g}"
        parts.append(f"${side} using 1:2 with linespoints {gnuplot.line_style(place)} title {gnuplot.quoted(title)}")
    lowest = min(points[min(2, len(points) - 1)][1] for points in result["curves"].values()) * 100
    return gnuplot.draw("dsgd_digits", "".join(data) + f"""set xlabel 'ms since the beginning'
set ylabel 'accuracy on other images, %'
set yrange [{max(0, lowest - 5)}:100]
set key bottom right Left reverse samplen 3
plot {', '.join(parts)}, {WANTED_ACCURACY * 100} with lines linecolor '#888888' dashtype (4,3) notitle
""", 760, 420, pictures.note_of(result))


def measured(options):
    rounds, seeds = options.rounds, range(1, options.seeds + 1)
    with tempfile.TemporaryDirectory(prefix="cles-digits-") as folder, Laboratory(options, folder) as laboratory:
        search = SEARCH_SEEDS[:1] if options.quick else SEARCH_SEEDS
        rates = {side: searched_rate(laboratory, side, rounds, search) for side in SIDES}
        courses, speeds = {side: [] for side in SIDES}, {side: [] for side in SIDES}
        for seed in seeds:
            for place in range(len(SIDES)):  # in turn, each seed from another one on
                side = list(SIDES)[(seed + place) % len(SIDES)]
                courses[side].append(laboratory.run(side, rates[side], seed, rounds, 1))
                speeds[side].append(laboratory.run(side, rates[side], seed, rounds, 0)["images_per_s"])
            print(f"\rdigits: {seed} of {options.seeds} seeds", end="", file=sys.stderr, flush=True)
        print(file=sys.stderr)
    return {"rates": rates, "figures": list(figures_of(speeds, courses, rounds)), "curves": curves_of(courses)}


def main():
    parser = argparse.ArgumentParser(description="Measures distributed descent on handwritten digits.")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--from", dest="source", metavar="FILE", help="the file of the digits, as of scripts/digits")
    parser.add_argument("--download", action="store_true", help="as of scripts/digits")
    parser.add_argument("--drawn", action="store_true", help="drawn digits, for which nothing is needed")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--hidden", type=int, default=64)
    parser.add_argument("--quick", action="store_true", help="2 seeds, 8 rounds: shows that it works, not how fast")
    parser.add_argument("-o", "--output", default="-")
    parser.add_argument("--picture", metavar="FILE", help="draws the accuracy over time, as SVG")
    options = parser.parse_args()
    if not (options.source or options.download or options.drawn or os.path.exists(INSTALLED)):
        options.drawn, options.download = options.quick, not options.quick
    if options.quick:
        options.seeds, options.rounds = 2, 8
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what it started is ended
    before = machine()  # before anything runs
    try:
        found = measured(options)
    except NoDigits:
        print("digits_speed.py: there are no digits: install python3-sklearn, or use --drawn", file=sys.stderr)
        return NOTHING_TO_MEASURE
    result = {"title": "Distributed descent on handwritten digits", **found, "seeds": options.seeds,
              "series": {"accuracy": {"title": "Accuracy on other images, over time: medians over the seeds.", "x": "ms since the "
                                      "beginning", "y": "accuracy, %", "lines": lines_of(found["curves"])}},
              "rounds": options.rounds, "hidden": options.hidden, "drawn": options.drawn, "quick": options.quick,
              "machine": before, "date": date(), "command": "python3 " + command("perf/evaluation/digits_speed.py")}
    write(result, options.output)
    for each in result["figures"]:
        interval = f" ({each['low']:.4g} to {each['high']:.4g})" if "low" in each else ""
        print(f"{each['what']}: {each['value']:.4g}{interval} {each['unit']}", file=sys.stderr)
    if options.picture:
        Path(options.picture).write_text(picture_of(result), encoding="utf-8")
    missed = [each for each in result["figures"] if each.get("reached") is False]
    return 1 if missed and not options.quick else 0


if __name__ == "__main__":
    sys.exit(main())
