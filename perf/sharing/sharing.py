#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures what nodes gain by sharing their jobs, and what moving a job costs.

    perf/sharing/sharing.py [--build build/release] [--rounds 5] [--jobs 2000] [--only NAME...] [--smoke]

- `four`: jobs of 10 ms, sleeping, are sent by name to one node of four with one worker each, and to a node that is alone.
- `quotas`: jobs that compute for 20 ms are sent to one of three nodes that may use 40, 40 and 10 % of a processor. The
  ideal is that all three compute all the time. Requires root, for the quotas.
- `workers`: jobs are sent to one of two nodes with 1, 2, 4 and 8 workers each: of 10 ms; and of three tasks, of 2, 10 and 100 ms,
  mixed. All sleep. The ideal is that no worker is idle before the last job has begun: the work, divided by all workers.
- `moved`: an empty job that moves, compared with one that runs at the node to which it is sent, in round trips of a PULL.
  As between machines, each message wakes a core: a client and the node to which jobs move have one, the other nodes another.

Each figure is the median of the rounds, and all sides are measured in each round. Nodes are on loopback. The exit code is 1
if a figure is not met, except with `--smoke`: a short run, for other machines than an idle one.
"""

import argparse
import contextlib
import json
import os
import pathlib
import random
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "evaluation"))
from clean_environment import clean_environment  # noqa: E402

TIMEOUT_S = 60
QUOTAS = (0.4, 0.4, 0.1)
WORKERS = (1, 2, 4, 8)
KINDS = {"of 10 ms": ("sleep/10",), "of 2, 10 and 100 ms": ("short/2", "sleep/10", "long/100")}
PERIOD_US = 10_000


class Node:
    """A daemon at a port that the system chooses."""

    def __init__(self, build, folder, name, seeds=(), command=(), workers=1):
        config = pathlib.Path(folder) / f"{name}.yaml"
        config.write_text(f"node: {name}\nlisten: tcp://127.0.0.1:0\nmulticast: off\nworkers: {workers}\nqueue: 100000\n"
                          f"seeds: [{', '.join(node.url for node in seeds)}]\nlog: {{level: error}}\n"
                          f"plugins: [{build}/perf/sharing/work.so]\n", encoding="utf-8")
        self.name = name
        self.process = subprocess.Popen([*command, f"{build}/apps/clesd", "--config", str(config)],
                                        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True,
                                        env=clean_environment())
        self.url = self.process.stdout.readline().split()[-1]
        self.port = int(self.url.rpartition(":")[2])

    def connect(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=TIMEOUT_S)

    def ask(self, request):
        with self.connect() as link, link.makefile("rw", encoding="utf-8", newline="\n") as lines:
            lines.write(request + "\n")
            lines.flush()
            return json.loads(lines.readline())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


class Pool:
    """Nodes that know each other, and each other's tasks."""

    def __init__(self, build, names, commands=None, workers=None):
        with contextlib.ExitStack() as opened:
            folder = opened.enter_context(tempfile.TemporaryDirectory(prefix="cles-sharing-"))
            self.nodes = []
            for i, name in enumerate(names):
                command = commands[i] if commands else ()
                self.nodes.append(opened.enter_context(Node(build, folder, name, self.nodes[:1], command,
                                                            workers[i] if workers else 1)))
            end = time.monotonic() + TIMEOUT_S
            while not all(self.knows_all(node) for node in self.nodes):
                if time.monotonic() > end:
                    sys.exit("sharing.py: the nodes did not find each other")
                time.sleep(0.05)
            self.opened = opened.pop_all()

    def knows_all(self, node):
        """Whether a request for each other node arrives there, and `any` knows that it offers the tasks."""
        others = [other for other in self.nodes if other is not node]
        live = {peer["node"] for peer in node.ask("PULL self:cles/peers")["peers"] if peer["state"] == "live"}
        if live != {other.name for other in others}:
            return False
        answers = node.ask("PULL all:nothing deadline=1000")
        return set(answers["results"]) == {other.name for other in self.nodes}

    def run(self, task, count):
        return self.run_all([task] * count)

    def run_all(self, tasks):
        """Sends jobs to the first node; returns the seconds until the last reply, and how many ran at each node."""
        ran = {}
        with self.nodes[0].connect() as link, link.makefile("r", encoding="utf-8") as replies:
            lines = [f"DELEGATE {self.nodes[0].name}:{task} id={i + 1} deadline=600000\n" for i, task in enumerate(tasks)]
            begun = time.monotonic()
            sender = threading.Thread(target=link.sendall, args=("".join(lines).encode(),))
            sender.start()
            for _ in tasks:
                reply = json.loads(replies.readline().partition(" ")[2])
                node = reply.get("node") or sys.exit(f"sharing.py: a job failed: {reply}")
                ran[node] = ran.get(node, 0) + 1
            took = time.monotonic() - begun
            sender.join()
        return took, ran

    def moved(self):
        return self.nodes[0].ask("PULL self:cles/metrics")["jobs_moved_out"]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.opened.close()


class Quota:
    """A group of processes that may use a part of one processor. Reason in `why_not` if there is none."""

    def __init__(self, share):
        self.path, self.why_not = None, ""
        name = f"cles-sharing-{os.getpid()}-{id(self)}"
        for folder, files in (("/sys/fs/cgroup/cpu", {"cpu.cfs_period_us": f"{PERIOD_US}",
                                                      "cpu.cfs_quota_us": f"{int(share * PERIOD_US)}"}),
                              ("/sys/fs/cgroup", {"cpu.max": f"{int(share * PERIOD_US)} {PERIOD_US}"})):
            path = pathlib.Path(folder) / name
            try:
                path.mkdir()
                for file, text in files.items():
                    (path / file).write_text(text, encoding="ascii")
                self.path = path
                return
            except OSError as error:
                self.why_not = str(error)
                with contextlib.suppress(OSError):
                    path.rmdir()

    def command(self):
        return ["sh", "-c", 'echo $$ > "$0/cgroup.procs" && exec "$@"', str(self.path)]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.path:
            end = time.monotonic() + TIMEOUT_S
            while True:
                try:
                    self.path.rmdir()
                    return
                except OSError:  # the processes are about to end
                    if time.monotonic() > end:
                        return
                    time.sleep(0.01)


def measure_four(options):
    ratios = []
    for _ in range(options.rounds):
        with Pool(options.build, ["alone"]) as pool:
            alone, _ = pool.run("sleep/10", options.jobs)
        with Pool(options.build, ["sat1", "sat2", "sat3", "sat4"]) as pool:
            four, ran = pool.run("sleep/10", options.jobs)
            moved = pool.moved()
        ratios.append(alone / four)
        print(f"four: {options.jobs} jobs of 10 ms: alone {alone:.2f} s, with three others {four:.2f} s, "
              f"{alone / four:.2f} times as fast; run {dict(sorted(ran.items()))}, {moved} moved")
    return {"figure": "times as fast", "median": statistics.median(ratios), "wanted": "≥ 3.6",
            "met": statistics.median(ratios) >= 3.6}


def measure_quotas(options):
    ms, count = 20, max(30, options.jobs // 5)
    over = []
    for _ in range(options.rounds):
        with contextlib.ExitStack() as opened:
            quotas = [opened.enter_context(Quota(share)) for share in QUOTAS]
            if not all(quota.path for quota in quotas):
                return {"figure": "quotas", "skipped": quotas[0].why_not}
            with Pool(options.build, ["sat1", "sat2", "sat3"], [quota.command() for quota in quotas]) as pool:
                pool.run(f"compute/{ms}", 20)  # they measure how long a job takes
                took, ran = pool.run(f"compute/{ms}", count)
                moved = pool.moved()
        ideal = count * ms / 1000 / sum(QUOTAS)
        over.append(took / ideal)
        print(f"quotas: {count} jobs of {ms} ms: {took:.2f} s, ideal {ideal:.2f} s: {took / ideal:.3f}; "
              f"run {dict(sorted(ran.items()))}, {moved} moved")
    return {"figure": "compared with the ideal division", "median": statistics.median(over), "wanted": "≤ 1.15",
            "met": statistics.median(over) <= 1.15}


def measure_workers(options):
    """Of each pair of nodes the median, and of these the highest."""
    pairs = [(1, 8), (8, 1)] if options.smoke else [(near, far) for near in WORKERS for far in WORKERS]
    ratios = {}
    for turn in range(options.rounds):
        for kind, tasks in KINDS.items():
            for near, far in pairs:
                jobs = [tasks[i % len(tasks)] for i in range(options.jobs * 9 // 10)]
                random.Random(turn).shuffle(jobs)
                work = sum(int(job.partition("/")[2]) for job in jobs) / 1000
                with Pool(options.build, ["sat1", "sat2"], workers=(near, far)) as pool:
                    took, ran = pool.run_all(jobs)
                    moved = pool.moved()
                ideal = work / (near + far)
                ratios.setdefault((kind, near, far), []).append(took / ideal)
                print(f"workers: {len(jobs)} jobs {kind} at {near} beside {far}: {took:.2f} s, ideal {ideal:.2f} s: "
                      f"{took / ideal:.3f}; run {dict(sorted(ran.items()))}, {moved} moved", flush=True)
    (kind, near, far), worst = max(((pair, statistics.median(found)) for pair, found in ratios.items()), key=lambda each: each[1])
    return {"figure": f"compared with the ideal, jobs {kind} at {near} beside {far} workers, the worst pair", "median": worst,
            "wanted": "≤ 1.2", "met": worst <= 1.2}


def measure_moved(options):
    more = []
    for _ in range(options.rounds):
        cores = sorted(os.sched_getaffinity(0))
        near, far = (["taskset", "-c", f"{core}"] for core in (cores[0], cores[-1]))
        with Pool(options.build, ["direct"], [far]) as alone, Pool(options.build, ["free", "busy"], [near, far]) as pool:
            urls = [alone.nodes[0].url, pool.nodes[1].url]
            shown = subprocess.run([*near, f"{options.build}/perf/sharing/cles_moved_job", *urls],
                                   stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
                                   timeout=TIMEOUT_S, env=clean_environment())
        if shown.returncode != 0:
            sys.exit(f"sharing.py: {shown.stderr.strip()}")
        found = json.loads(shown.stdout)
        more.append(found["more_round_trips"])
        print(f"moved: a PULL {found['round_trip_us']} us, a job sent directly {found['direct_us']} us, one that moves "
              f"{found['moved_us']} us: {found['more_round_trips']} round trips more; {found['not_moved']} did not move")
    return {"figure": "round trips more", "median": statistics.median(more), "wanted": "≤ 1.5",
            "met": statistics.median(more) <= 1.5}


MEASURES = {"four": measure_four, "quotas": measure_quotas, "workers": measure_workers, "moved": measure_moved}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=lambda text: pathlib.Path(text).resolve(), default="build/release")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--only", nargs="+", choices=MEASURES, default=list(MEASURES))
    parser.add_argument("--smoke", action="store_true")
    options = parser.parse_args()
    if options.smoke:
        options.rounds, options.jobs = 1, min(options.jobs, 200)
    options.build = pathlib.Path(options.build).resolve()
    results = {name: MEASURES[name](options) for name in options.only}
    for name, found in results.items():
        if "skipped" in found:
            print(f"{name}: not measured: {found['skipped']}")
        else:
            print(f"{name}: median of {options.rounds}: {found['median']:.2f} {found['figure']} (wanted {found['wanted']})"
                  f"{'' if found['met'] else ', NOT MET'}")
    return 0 if options.smoke or all(found.get("met", True) for found in results.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
