#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Daemons share the jobs that wait in their queues: these run once, wherever there is a free worker."""

import collections
import json
import signal
import time
import unittest

from daemon import Daemon
from fleet import Fleet
from load import DEADLINE, SLACK, Load
from support import wait_until

COUNTS = ("jobs_moved_out", "jobs_moved_in", "grants_sent", "grants_received", "granted_jobs_refused")


class Sharing(unittest.TestCase):
    def start(self, count, **options):
        self.fleet = Fleet(count, **options)
        self.addCleanup(self.fleet.__exit__)
        return self.fleet

    def load_at(self, name):
        load = Load(self.fleet[name], self.fleet.names)
        self.addCleanup(load.__exit__)
        return load

    def metrics(self, name):
        found = json.loads(self.fleet[name].ask("PULL self:cles/metrics"))
        return {key: found[key] for key in COUNTS}

    def run_at(self):
        """How many jobs ran at each node, each once."""
        marks = self.fleet.marks()
        self.assertEqual([number for number, nodes in marks.items() if len(nodes) != 1], [])
        return collections.Counter(nodes[0] for nodes in marks.values())

    def wait_for_all(self, load, jobs):
        load.wait_until(lambda: all(job.ended for job in jobs), "all jobs have ended")

    def test_jobs_sent_to_one_node_run_on_all(self):
        self.start(4, queue=1000)
        load = self.load_at("sat1")
        begun = time.monotonic()
        jobs = load.burst("sat1", 400, work_ms=20)
        self.wait_for_all(load, jobs)
        took = time.monotonic() - begun
        self.assertEqual({job.code for job in jobs}, {None})
        ran = self.run_at()
        counts = {name: self.metrics(name) for name in self.fleet.names}
        print(f"400 jobs of 20 ms by 8 workers took {took:.2f} s: {dict(ran)}")
        self.assertEqual(sum(ran.values()), 400)
        self.assertEqual(set(ran), set(self.fleet.names))
        self.assertGreater(min(ran.values()), 40)
        self.assertEqual(counts["sat1"]["jobs_moved_out"], 400 - ran["sat1"])
        for name in ("sat2", "sat3", "sat4"):
            self.assertEqual(counts[name]["jobs_moved_in"], ran[name])
            self.assertEqual(counts[name]["jobs_moved_out"], 0)  # a job moves once
        self.assertLess(took, 400 * 0.020 / 2)  # less than half of what the two workers of sat1 need

    def test_only_if_it_is_wanted(self):
        self.start(2, more="sharing: false\n")
        load = self.load_at("sat1")
        jobs = load.burst("sat1", 8, work_ms=20)
        self.wait_for_all(load, jobs)
        self.assertEqual(set(self.run_at()), {"sat1"})
        reply = json.loads(self.fleet["sat1"].ask('PUSH self:cles/slots {"node":"sat2","waiting":1}'))
        self.assertEqual(reply["error"], "no_task")

    def test_jobs_that_hold_a_worker_are_told_to_stop_wherever_they_are(self):
        self.start(3)
        load = self.load_at("sat1")
        held = [load.send("sat1", "holds", deadline=60) for _ in range(6)]  # two for each node
        load.wait_until(lambda: len(self.fleet.marks()) == 6, "all have begun")
        self.assertEqual({name: len(self.at(name)) for name in self.fleet.names},
                         {"sat1": 2, "sat2": 2, "sat3": 2})
        for job in held:
            load.write([f"PUSH self:cles/cancel/{job.number} reply=no\n"])
        self.wait_for_all(load, held)
        self.assertEqual({job.code for job in held}, {"cancelled"})
        for name in self.fleet.names:
            wait_until(lambda name=name: json.loads(self.fleet[name].ask("PULL self:cles"))["load"]["running"] == 0,
                       f"no job runs at {name}")

    def at(self, name):
        return [number for number, nodes in self.fleet.marks().items() if nodes == [name]]

    def test_jobs_end_at_their_deadline_wherever_they_are(self):
        self.start(2)
        load = self.load_at("sat1")
        held = [load.send("sat1", "holds", deadline=1) for _ in range(4)]
        self.wait_for_all(load, held)
        self.assertEqual({job.code for job in held}, {"deadline"})
        self.assertLess(load.latest(), 1 + SLACK)
        self.assertEqual(len(self.fleet.marks()), 4)

    def test_a_node_that_runs_moved_jobs_is_killed(self):
        self.start(2)
        load = self.load_at("sat1")
        held = [load.send("sat1", "holds", deadline=60) for _ in range(4)]
        load.wait_until(lambda: len(self.fleet.marks()) == 4, "all have begun")
        moved = set(self.at("sat2"))
        self.assertEqual(len(moved), 2)
        self.fleet.kill("sat2")
        lost = [job for job in held if job.number in moved]
        load.wait_until(lambda: all(job.ended for job in lost), "they are lost")
        self.assertEqual({job.code for job in lost}, {"unavailable"})
        # They are not run again, although a worker becomes free.
        for job in held:
            load.write([f"PUSH self:cles/cancel/{job.number} reply=no\n"])
        done = load.send("sat1", "once")
        self.wait_for_all(load, [*held, done])
        self.assertEqual(done.code, None)
        self.assertEqual(sum(self.run_at().values()), 5)

    def test_a_node_that_stops_waits_for_the_jobs_that_it_has_moved(self):
        self.start(2, more="drain: 5s\n")
        load = self.load_at("sat1")
        jobs = load.burst("sat1", 4, work_ms=400)
        load.wait_until(lambda: len(self.fleet.marks()) == 4, "all have begun")
        self.fleet["sat1"].send_signal(signal.SIGTERM)
        self.wait_for_all(load, jobs)
        self.assertEqual([job for job in jobs if job.code], [])
        self.assertEqual(self.run_at(), {"sat1": 2, "sat2": 2})

    def test_bad_grants_have_clear_answers(self):
        self.start(2)
        node = self.fleet["sat1"]
        for line, code in (('PUSH self:cles/slots {"node":"nobody","waiting":3}', "bad_request"),
                           ('PUSH self:cles/slots {"free":3}', "bad_request"),
                           ("PUSH self:cles/slots", "bad_request"),
                           ('PUSH self:cles/slots grant=1 {"node":"sat2","free":3}', "bad_request"),
                           ('PUSH self:cles/slots grant=00000000000000aa {"node":"sat2","free":0}', "bad_request"),
                           ("DELEGATE self:once/1/1 via=sat2 hops=0 grant=00000000000000aa", "denied"),
                           ("DELEGATE self:once/2/1 grant=00000000000000aa", "denied")):
            reply = json.loads(node.ask(line))
            self.assertEqual(reply["error"], code, line)
            self.assertTrue(reply["message"].startswith("sat1"), reply)
        # A grant that sat2 has not given is for jobs that are not there; one with jobs is refused by sat2.
        self.assertEqual(json.loads(node.ask('PUSH self:cles/slots grant=00000000000000aa {"node":"sat2","free":3}')),
                         {"taken": 0, "waiting": 0})
        load = self.load_at("sat1")
        held = [load.send("sat1", "holds", deadline=60) for _ in range(4)]
        load.wait_until(lambda: len(self.fleet.marks()) == 4, "all workers are taken")
        waiting = load.send("sat1", "once")
        wait_until(lambda: json.loads(node.ask("PULL self:cles"))["load"]["queued"] == 1, "it waits")
        refused = self.metrics("sat2")["granted_jobs_refused"]  # of those that it had granted a slot
        forged = json.loads(node.ask('PUSH self:cles/slots grant=00000000000000aa {"node":"sat2","free":1}'))
        self.assertEqual(forged["taken"], 1)
        wait_until(lambda: self.metrics("sat2")["granted_jobs_refused"] == refused + 1, "sat2 has refused it")
        wait_until(lambda: json.loads(node.ask("PULL self:cles"))["load"]["queued"] == 1, "it waits again")
        for job in held:
            load.write([f"PUSH self:cles/cancel/{job.number} reply=no\n"])
        self.wait_for_all(load, [*held, waiting])
        self.assertEqual(waiting.code, None)
        self.assertEqual(self.metrics("sat1")["granted_jobs_refused"], 2)
        self.assertEqual(sum(self.run_at().values()), 5)


if __name__ == "__main__":
    unittest.main()
