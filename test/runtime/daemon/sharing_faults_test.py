#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Daemons that share jobs with effects are killed and suspended: every job has a known fate, none has its effect twice,
and each daemon is soon back in the pool.

    sharing_faults_test.py [--kills N] [--stops N] [--jobs N] [--seed N]

The defaults are those of the test; `--kills 200 --stops 50 --jobs 30000` takes some minutes.
"""

import argparse
import collections
import json
import random
import sys
import time

from fleet import Fleet
from load import DEADLINE, FATES, RUNS, SLACK, Load
from support import PATIENCE

NODES = 5
BACK_WITHIN = 5  # seconds


class Faults:
    def __init__(self, fleet, wanted):
        self.fleet, self.wanted = fleet, wanted
        self.draw = random.Random(wanted.seed)
        self.backs = []
        self.loads = []
        self.enter()

    def enter(self):
        """The client has a link to sat1; a new one if the node was killed."""
        load = Load(self.fleet["sat1"], self.fleet.names)
        load.PACE = 0.004
        load.MIX = (("sat1", "once"), ("sat1", "once"), ("sat1", "again"), ("any", "once"), ("any", "again"))
        if self.loads:  # numbers are those of all
            load.jobs = self.loads[-1].jobs
        self.loads.append(load)

    @property
    def load(self):
        return self.loads[-1]

    def run(self, seconds=None, until=None, what=""):
        """Jobs of some length, in bursts, so that queues form."""
        end = time.monotonic() + (seconds if seconds is not None else PATIENCE)
        while time.monotonic() < end:
            if until is not None and until():
                return
            self.load.burst(self.draw.choice(("sat1", "sat1", "any")), self.draw.randrange(1, 40), self.draw.randrange(2, 12))
            self.load.run(self.draw.uniform(0.01, 0.08))
            if not self.load.linked:
                return
        if until is not None:
            raise AssertionError(f"waited in vain: {what}")

    def fill(self):
        """All nodes are at work for a while."""
        self.load.burst("sat1", 120, self.draw.randrange(5, 15))
        self.load.run(self.draw.uniform(0.005, 0.06))

    def kill(self):
        name = self.draw.choice(self.fleet.names)
        self.fill()
        self.fleet.kill(name)
        if name == "sat1":
            self.load.wait_until(lambda: not self.load.linked, "the link is lost")
        else:
            self.run(self.draw.uniform(0, 0.4))
        started = time.monotonic()
        self.fleet.nodes[name] = self.fleet.opened.enter_context(self.fleet.start(name))
        if name == "sat1":
            self.enter()
        self.run(until=lambda: self.is_back(name), what=f"{name} is back")
        self.backs.append(time.monotonic() - started)

    def stop(self):
        name = self.draw.choice(self.fleet.names[1:])
        self.fill()
        self.fleet.pause(name)
        self.run(self.draw.choice((0.05, 0.3, 1, 4.5)))
        self.fleet.resume(name)
        resumed = time.monotonic()
        self.run(until=lambda: self.is_back(name), what=f"{name} is back")
        self.backs.append(time.monotonic() - resumed)

    def is_back(self, name):
        """All others know its current run."""
        epoch = json.loads(self.fleet[name].ask("PULL self:cles"))["epoch"]
        others = [other for other in self.fleet.names if other != name]
        return all(any(peer["node"] == name and peer["epoch"] == epoch and peer["state"] == "live"
                       for peer in self.fleet.peers_at(other)) for other in others)

    def account(self):
        self.load.wait_until(lambda: not self.load.flying, "all jobs have ended")
        moved = sum(json.loads(self.fleet[name].ask("PULL self:cles/metrics"))["jobs_moved_in"]
                    for name in self.fleet.names)
        jobs = self.load.jobs
        marks = self.fleet.marks()
        wrong = []
        for job in jobs:
            runs = len(marks[job.number])
            if job.ended is None or job.code not in FATES:
                wrong.append(f"{job} has no fate")
            elif job.task == "again" and job.target == "any":  # repeated once, if its node was lost
                if runs > 2 or (runs == 0 and job.code is None):
                    wrong.append(f"{job} ran at {marks[job.number]}")
            elif runs not in RUNS[job.code]:
                wrong.append(f"{job} ran at {marks[job.number]}")
        print(f"{self.load.told()}; {moved} moved since the nodes were last started; back in the pool after "
              f"{max(self.backs):.2f} s at most, {sorted(self.backs)[len(self.backs) // 2]:.2f} s in the median")
        for task, kind in (("once", "with effects"), ("again", "idempotent")):
            runs = collections.Counter(len(marks[job.number]) for job in jobs if job.task == task)
            print(f"jobs {kind}: " + ", ".join(f"{count} ran {times} times" for times, count in sorted(runs.items())))
        if wrong:
            raise AssertionError("\n".join(wrong[:20]))
        if moved == 0:
            raise AssertionError("no job moved")
        if max(self.backs) > BACK_WITHIN + SLACK:
            raise AssertionError("a node was not back in time")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=8)
    parser.add_argument("--stops", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    wanted = parser.parse_args()
    with Fleet(NODES, queue=2000) as fleet:
        faults = Faults(fleet, wanted)
        todo = ["kill"] * wanted.kills + ["stop"] * wanted.stops
        faults.draw.shuffle(todo)
        begun = time.monotonic()
        for number, what in enumerate(todo, 1):
            faults.run(0.2)
            getattr(faults, what)()
            if sys.stderr.isatty() or number % 50 == 0:
                print(f"{number} of {len(todo)} faults, {len(faults.load.jobs)} jobs, {time.monotonic() - begun:.0f} s",
                      file=sys.stderr)
        while len(faults.load.jobs) < wanted.jobs:
            faults.run(0.2)
        faults.account()
    return 0


if __name__ == "__main__":
    sys.exit(main())
