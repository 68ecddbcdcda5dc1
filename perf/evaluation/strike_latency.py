#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures how long a strike order takes while video frames saturate the node that executes it, and on an idle node.

    strike_latency.py [--programs build/release/apps] [--rounds 10] [--orders 1000] [--streams 4] [--workers N]
                      [--real-time N] [--busy-poll US] [--quick] [-o FILE]

One daemon offers both FMV_Processing and strike. In each round the orders are measured once while nothing else is asked of
it, and once while each of the streams has a frame on its way at any time, so that all workers are busy. Writes JSON. Wanted
is a p99 that is at most twice that of the idle node: the median over the rounds.

Two daemons are measured in turn: one that is configured for urgent work, and one with the defaults of clesd, so without a
priority, with a worker on each core, and without polling. The first one has, without --workers, one worker less than there
are cores (one at least), so that there is a core for what is urgent; where it may, its I/O thread runs under SCHED_FIFO
(--real-time); and it polls only with --busy-poll. What both had is beside each figure.
"""

import argparse
import contextlib
import dataclasses
import json
import os
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile

from clean_environment import clean_environment
from deferred_signals import DeferredSignals, first_line
from interval import summary
from provenance import command, date, machine
from result_file import write

WANTED = 2.0
URGENT, DEFAULT = "urgent", "default"  # the two setups
PATIENCE = 60  # seconds for a program to print its first line


@dataclasses.dataclass(frozen=True)
class Setup:
    """What the configuration of a daemon says of it; a value that is None is left to the daemon."""
    workers: int | None = None
    real_time: int | None = None
    busy_poll: int | None = None  # microseconds

    def yaml(self):
        values = {"workers": self.workers, "real_time": self.real_time,
                  "busy_poll": None if self.busy_poll is None else f"{self.busy_poll}us"}
        return "".join(f"{key}: {value}\n" for key, value in values.items() if value is not None)

    def text(self, cores):
        workers = os.cpu_count() if self.workers is None else self.workers  # the daemon's default
        return ", ".join([f"SCHED_FIFO priority {self.real_time}" if self.real_time else "no priority",
                          f"{workers} worker{'s' if workers != 1 else ''} on {cores} core{'s' if cores != 1 else ''}",
                          f"polling for {self.busy_poll} us" if self.busy_poll else "no polling"])


@contextlib.contextmanager
def running(words, **how):
    """A program that is ended with the block."""
    process = None
    try:
        with DeferredSignals():
            process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
                                       env=clean_environment(), **how)
        yield process
    finally:
        if process is not None:
            end(process)


def end(process):
    if process.poll() is None:
        process.terminate()
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    process.stdout.close()


@contextlib.contextmanager
def node(options, setup):
    """A daemon that offers both; its value is its address."""
    plugins = os.path.abspath(os.path.join(options.programs, "..", "plugins"))
    with tempfile.TemporaryDirectory(prefix="cles-strike-") as folder:
        config, log = os.path.join(folder, "node.yaml"), os.path.join(folder, "log")
        with open(config, "w", encoding="utf-8") as file:
            file.write(f"node: node\nlisten: [tcp://127.0.0.1:0]\nmulticast: off\n{setup.yaml()}plugins:\n"
                       f"  - {{path: {plugins}/libcles-fmv.so, config: {{streams: 64, idle_s: 1}}}}\n"
                       f"  - {plugins}/libcles-strike.so\n")
        with open(log, "w+", encoding="utf-8") as said, \
                running([os.path.join(options.programs, "clesd"), "--config", config], stderr=said) as process:
            found = re.search(r"listening on (tcp://\S+)", first_line(process, PATIENCE))
            if not found:
                said.seek(0)
                raise SystemExit(f"strike_latency.py: the node did not start: {said.read()}")
            yield found[1]


def drill(programs, url, orders):
    done = subprocess.run([os.path.join(programs, "cles-jadc2"), "drill", "--at", url, "--count", str(orders)],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, env=clean_environment())
    if done.returncode != 0:
        raise SystemExit(f"strike_latency.py: the drill ended with {done.returncode}: {done.stderr}")
    return json.loads(done.stdout)


def drill_beside_load(options, url):
    """Sends orders while frames are sent as fast as they are answered; returns the results of both."""
    with running([os.path.join(options.programs, "cles-jadc2"), "load", "--at", url, "--streams", str(options.streams),
                  "--duration", "0"]) as load:
        if first_line(load, PATIENCE) != "loading\n":
            raise SystemExit("strike_latency.py: the load did not begin")
        orders = drill(options.programs, url, options.orders)
        load.terminate()  # then it prints its result
        out, _ = load.communicate(timeout=60)
        if load.returncode != 0:
            raise SystemExit(f"strike_latency.py: the load ended with {load.returncode}")
        return orders, json.loads(out)


def measure(options, setups):
    """{name of the setup: {"idle": the orders of each round, "loaded": likewise, "load": what the load achieved}}"""
    found = {name: {"idle": [], "loaded": [], "load": []} for name in setups}
    with contextlib.ExitStack() as stack:
        urls = {name: stack.enter_context(node(options, setup)) for name, setup in setups.items()}
        for url in urls.values():
            drill(options.programs, url, 50)  # warms up
        for number in range(1, options.rounds + 1):
            for name in sorted(setups, reverse=number % 2 == 0):
                found[name]["idle"].append(drill(options.programs, urls[name], options.orders))
                orders, load = drill_beside_load(options, urls[name])
                found[name]["loaded"].append(orders)
                found[name]["load"].append(load)
            print(f"\rstrike: {number} of {options.rounds} rounds", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return found


def figure(name, what, values, unit, **beside):
    found = summary(values)
    return {"name": name, "what": what, "value": found["median"], "low": found["low"], "high": found["high"],
            "runs": found["runs"], "unit": unit, "paper": None, "target": None, "reached": None, **beside}


def p99_ratios(above, below):
    return [one["p99_us"] / other["p99_us"] for one, other in zip(above, below)]


def figures(found, texts):
    """\param found as `measure` returns it \param texts {name of the setup: what it is}"""
    out = []
    for setup, rounds in found.items():
        prefix = "strike_" if setup == URGENT else f"strike_{setup}_"
        for state, whom in (("idle", "an idle node"), ("loaded", "a node that video frames saturate")):
            out += [figure(f"{prefix}{state}_{quantile}", f"an order to strike, to {whom}, {quantile}: {texts[setup]}",
                           [each[f"{quantile}_us"] for each in rounds[state]], "us") for quantile in ("p50", "p99")]
        ratios = p99_ratios(rounds["loaded"], rounds["idle"])
        out.append(figure(f"{prefix}ratio", f"an order to strike: p99 of the saturated node, to the idle one: {texts[setup]}",
                          ratios, "times", target=f"\u2264 {WANTED:g}", reached=statistics.median(ratios) <= WANTED,
                          ran=f"the same node with and without video, orders urgent and one after the other: {texts[setup]}"))
        out.append(figure(f"{prefix}frames", f"frames in a second meanwhile: {texts[setup]}",
                          [each["frames_a_second"] for each in rounds["load"]], "/s"))
        out.append(figure(f"{prefix}frame_run", f"how long a frame is processed meanwhile, on average: {texts[setup]}",
                          [each["mean_run_ms"] for each in rounds["load"]], "ms"))
    out.append(figure("strike_urgent_to_default",
                      "an order to strike, p99 of saturated nodes: configured for it, to the defaults",
                      p99_ratios(found[URGENT]["loaded"], found[DEFAULT]["loaded"]), "times",
                      ran=f"the same orders and video to both: {texts[URGENT]}; the defaults: {texts[DEFAULT]}"))
    return out


def may_run_in_real_time(programs):
    """Whether the daemon may have a real-time priority here."""
    if os.geteuid() != 0:
        return False
    done = subprocess.run(["chrt", "-f", "10", "true"], capture_output=True, check=False) if shutil.which("chrt") else None
    return done is not None and done.returncode == 0


def main():
    cores = len(os.sched_getaffinity(0))
    parser = argparse.ArgumentParser(description="Measures strike orders while video frames saturate the node.")
    parser.add_argument("--programs", default="build/release/apps")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--orders", type=int, default=1000, help="of each round, idle and loaded")
    parser.add_argument("--streams", type=int, default=4)
    parser.add_argument("--workers", type=int, default=max(1, cores - 1))
    parser.add_argument("--real-time", type=int, default=None, help="the I/O thread's priority; default: 10 if permitted; 0: none")
    parser.add_argument("--busy-poll", type=int, default=0, help="microseconds for which the daemon polls before it sleeps")
    parser.add_argument("--quick", action="store_true", help="2 short rounds: shows that it works, not how fast")
    parser.add_argument("-o", "--output", default="-")
    options = parser.parse_args()
    if options.quick:
        options.rounds, options.orders = 2, 200
    if options.real_time is None:
        options.real_time = 10 if may_run_in_real_time(options.programs) else 0
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what it started is ended
    before = machine()  # before anything runs
    setups = {URGENT: Setup(options.workers, options.real_time, options.busy_poll), DEFAULT: Setup()}
    texts = {name: setup.text(cores) for name, setup in setups.items()}
    found = measure(options, setups)
    result = {"title": "Allocation of tasks: strike orders while video frames saturate the node (section 4.2)",
              "command": command("perf/evaluation/strike_latency.py"), "machine": before, "date": date(),
              "quick": options.quick, "orders": options.orders, "streams": options.streams, "setups": texts,
              "figures": figures(found, texts), "rounds": found}
    write(result, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
