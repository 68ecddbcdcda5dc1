#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Daemons that are killed and paused while they run jobs: the outcome of every job is known, and nothing hangs."""

import signal
import time
import unittest

from fleet import Fleet
from load import DEADLINE, RUNS, SLACK, Load
from support import PATIENCE


class FaultTest(unittest.TestCase):
    DRAIN = "500ms"

    def setUp(self):
        self.fleet = Fleet(4, more=f"drain: {self.DRAIN}\n")
        self.addCleanup(self.fleet.__exit__)

    def load_at(self, name):
        load = Load(self.fleet[name], self.fleet.names)
        self.addCleanup(load.__exit__)
        return load

    def account(self, load, paused=0.0):
        """Every job has one outcome, and has left as many marks as this allows."""
        load.finish()
        for code in self.fleet.stop():
            self.assertEqual(code, 0)
        print(f"{self.id().rpartition('.')[2]}: {load.told()}; the longest took {load.latest():.2f} s")
        fates = load.fates()
        self.assertEqual(sum(fates.values()), len(load.jobs))
        self.assertGreater(fates["done"], 0)
        self.assertLessEqual(load.latest(), DEADLINE + SLACK + paused)
        marks = self.fleet.marks()
        for job in load.jobs:
            runs = len(marks[job.number])
            if job.task == "again":  # may run more than once if its node was lost
                self.assertTrue(runs > 0 or job.code is not None, job)
            else:
                self.assertIn(runs, RUNS[job.code], f"{job} ran at {marks[job.number]}")

    def crowd(self, load):
        """Sends more jobs than a node accepts, which it reports."""
        jobs = load.burst("sat2", 60, work_ms=20)
        load.run(until=lambda: all(job.ended for job in jobs), what="the burst is answered")
        self.assertIn("busy", {job.code for job in jobs})
        self.assertIn(None, {job.code for job in jobs})

    def hold(self, load, name):
        """A job that runs on that node, and does not end."""
        job = load.send(name, "holds_here")
        load.run(until=lambda: self.fleet.marks()[job.number], what="the job has begun")
        return job

    def lost_since(self, load, since):
        """How long after a moment the last job for anybody was sent that was lost; nothing where none was."""
        lost = [job.sent - since for job in load.jobs if job.sent >= since and job.target == "any" and job.lost]
        return max(lost, default=0.0)

    def serves(self, load, name, since):
        """A job for anybody that was sent since then ran there."""
        marks = self.fleet.marks()
        return any(name in marks[job.number] for job in load.jobs if job.sent >= since and job.target == "any")


class Faults(FaultTest):
    def test_a_node_is_killed(self):
        load = self.load_at("sat1")
        self.crowd(load)
        held = self.hold(load, "sat3")
        self.fleet.kill("sat3")
        killed = time.monotonic()
        load.run(1)
        self.assertEqual(held.code, "unavailable")  # at once, not at its deadline
        load.finish()
        after = self.lost_since(load, killed)
        print(f"no request goes to a node that was killed {after * 1000:.1f} ms after it")
        self.assertLessEqual(after, SLACK / 6)
        # Idempotent jobs are repeated.
        self.assertEqual([job for job in load.jobs if job.task == "again" and job.code == "unavailable"], [])
        self.account(load)

    def test_a_node_is_paused(self):
        load = self.load_at("sat1")
        load.run(0.3)
        held = self.hold(load, "sat3")
        self.fleet.pause("sat3")
        paused = time.monotonic()
        load.run(until=lambda: "sat3" not in self.fleet.live_at("sat1"), what="it is suspect")
        suspect = time.monotonic()
        load.run(DEADLINE / 2)
        resumed = time.monotonic()
        self.fleet.resume("sat3")
        load.run(until=lambda: self.serves(load, "sat3", resumed), what="it is asked again")
        print(f"it is asked again {time.monotonic() - resumed:.2f} s after it went on")
        load.finish()
        after = self.lost_since(load, paused)
        print(f"no request goes to a node that was paused {after:.2f} s after it; suspect after {suspect - paused:.2f} s")
        self.assertLessEqual(after, 3.5 + SLACK / 2)
        self.assertIn(held.code, ("deadline", "unavailable"))
        self.account(load)

    def test_a_busy_node_gets_no_jobs_while_others_are_free(self):
        load = self.load_at("sat1")
        load.PACE, load.MIX = 0.01, (("any", "once"),)  # far less than three nodes can do
        load.run(0.3)
        for name in ("sat3", "sat3", "sat4", "sat4"):
            job = load.send(name, "holds_here", deadline=PATIENCE)
            load.run(until=lambda number=job.number: self.fleet.marks()[number], what="the job has begun")
        held = lambda name: self.fleet.load_at("sat1", name).get("service_us", 0) >= 100_000
        load.run(until=lambda: held("sat3") and held("sat4"), what="it is known that no worker comes free")
        since = len(load.jobs)
        load.run(2)
        jobs = load.jobs[since:]
        load.run(until=lambda: all(job.ended for job in jobs), what="all have ended")
        marks = self.fleet.marks()
        self.assertGreater(len(jobs), 50)
        self.assertEqual([job for job in jobs if job.code or set(marks[job.number]) & {"sat3", "sat4"}], [])

    def test_the_routing_node_is_killed(self):
        load = self.load_at("sat1")
        load.run(0.3)
        held = self.hold(load, "sat1")
        begun_elsewhere = self.hold(load, "sat4")
        self.fleet.kill("sat1")
        load.run(until=lambda: not load.linked, what="the link is lost")
        self.assertEqual({held.code, begun_elsewhere.code}, {"link lost"})
        # Another node continues, and loses no more jobs.
        load.connect(self.fleet["sat2"])
        load.names = self.fleet.names[1:]
        since = time.monotonic()
        load.run(1)
        load.finish()
        self.assertLessEqual(self.lost_since(load, since), SLACK / 6)
        self.account(load)

    def test_the_routing_node_is_paused(self):
        load = self.load_at("sat1")
        load.run(0.3)
        self.fleet.pause("sat1")
        paused = time.monotonic()
        load.run(1)
        self.fleet.resume("sat1")
        pause = time.monotonic() - paused
        load.run(0.5)
        self.account(load, pause)


class Stops(FaultTest):
    """A node that is stopped waits for the jobs that it has passed on, and loses none."""

    DRAIN = "30s"

    def test_nodes_are_restarted_one_after_the_other(self):
        load = self.load_at("sat1")
        load.PACE, load.LIMIT, load.MIX = 0.001, 50, (("any", "once"),)
        load.run(0.3)
        for _ in range(3):
            for name in ("sat2", "sat3", "sat4"):
                self.fleet.restart(name, lambda condition, what: load.run(until=condition, what=what))
                load.run(0.4)
        load.run(until=lambda: len(load.jobs) > 1000, what="enough jobs are sent")
        load.finish()
        # Jobs that had not started were sent elsewhere, and the others were answered.
        self.assertEqual([job for job in load.jobs if job.code not in (None, "busy")], [])
        self.account(load)

    def test_the_routing_node_is_restarted(self):
        load = self.load_at("sat2")
        load.PACE, load.LIMIT, load.MIX = 0.001, 50, (("any", "once"), ("named", "once"))
        load.run(0.3)
        self.fleet["sat2"].send_signal(signal.SIGTERM)
        load.run(until=lambda: not load.linked, what="the link has ended")
        self.assertTrue(load.left)
        # Every job without an answer is known not to have started, so another node may be asked.
        self.assertEqual([job for job in load.jobs if job.code not in (None, "busy")], [])
        load.connect(self.fleet["sat3"])
        load.names = ["sat1", "sat3", "sat4"]
        load.run(0.3)
        self.account(load)


if __name__ == "__main__":
    unittest.main()
