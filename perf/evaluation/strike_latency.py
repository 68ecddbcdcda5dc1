#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures how long a strike order takes while video frames saturate the node that executes it, and on an idle node.

    strike_latency.py [--programs build/release/apps] [--rounds 10] [--orders 1000] [--streams 4] [--workers N] [--quick]
                      [-o FILE]

One daemon offers both FMV_Processing and strike. In each round the orders are measured once while nothing else is asked of
it, and once while each of the streams has a frame on its way at any time, so that all workers are busy. Writes JSON. Wanted
is a p99 that is at most twice that of the idle node: the median over the rounds. Without --workers the daemon has one
worker less than there are cores (one at least), so that there is a core for what is urgent. Where it may, its I/O thread
runs under SCHED_FIFO (--real-time).
"""

import argparse
import contextlib
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
PATIENCE = 60  # seconds for a program to print its first line


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
def node(options):
    """A daemon that offers both; its value is its address."""
    plugins = os.path.abspath(os.path.join(options.programs, "..", "plugins"))
    with tempfile.TemporaryDirectory(prefix="cles-strike-") as folder:
        config, log = os.path.join(folder, "node.yaml"), os.path.join(folder, "log")
        with open(config, "w", encoding="utf-8") as file:
            file.write(f"node: node\nlisten: [tcp://127.0.0.1:0]\nmulticast: off\nworkers: {options.workers}\n"
                       f"real_time: {options.real_time}\nplugins:\n"
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


def measure(options):
    idle, loaded, loads = [], [], []
    with node(options) as url:
        drill(options.programs, url, 50)  # warms up
        for number in range(1, options.rounds + 1):
            idle.append(drill(options.programs, url, options.orders))
            orders, load = drill_beside_load(options, url)
            loaded.append(orders)
            loads.append(load)
            print(f"\rstrike: {number} of {options.rounds} rounds", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return idle, loaded, loads


def figure(name, what, values, unit, **beside):
    found = summary(values)
    return {"name": name, "what": what, "value": found["median"], "low": found["low"], "high": found["high"],
            "runs": found["runs"], "unit": unit, "paper": None, "target": None, "reached": None, **beside}


def figures(idle, loaded, loads):
    out = []
    for state, rounds, whom in (("idle", idle, "an idle node"), ("loaded", loaded, "a node that video frames saturate")):
        out += [figure(f"strike_{state}_{quantile}", f"an order to strike, to {whom}, {quantile}",
                       [each[f"{quantile}_us"] for each in rounds], "us") for quantile in ("p50", "p99")]
    ratios = [there["p99_us"] / here["p99_us"] for here, there in zip(idle, loaded)]
    out.append(figure("strike_ratio", "an order to strike: p99 of the saturated node, to the idle one", ratios, "times",
                      target=f"\u2264 {WANTED:g}", reached=statistics.median(ratios) <= WANTED))
    out.append(figure("frames", "frames in a second meanwhile", [each["frames_a_second"] for each in loads], "/s"))
    out.append(figure("frame_run", "how long a frame is processed meanwhile, on average", [each["mean_run_ms"] for each in loads],
                      "ms"))
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
    parser.add_argument("--quick", action="store_true", help="2 short rounds: shows that it works, not how fast")
    parser.add_argument("-o", "--output", default="-")
    options = parser.parse_args()
    if options.quick:
        options.rounds, options.orders = 2, 200
    if options.real_time is None:
        options.real_time = 10 if may_run_in_real_time(options.programs) else 0
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what it started is ended
    before = machine()  # before anything runs
    idle, loaded, loads = measure(options)
    result = {"title": "Allocation of tasks: strike orders while video frames saturate the node (section 4.3)",
              "command": command("perf/evaluation/strike_latency.py"), "machine": before, "date": date(),
              "quick": options.quick, "orders": options.orders, "streams": options.streams, "workers": options.workers,
              "real_time": options.real_time, "figures": figures(idle, loaded, loads),
              "rounds": {"idle": idle, "loaded": loaded, "load": loads}}
    write(result, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
