#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The list of a daemon's jobs: those that wait for a worker, run, or do not stop; and how one is cancelled."""

import unittest

from daemon import STUBBORN, Daemon, body
from support import wait_until


class Jobs(unittest.TestCase):
    def setUp(self):
        self.daemon = Daemon(f"plugins: [{STUBBORN}]\n")
        self.addCleanup(self.daemon.__exit__)
        self.go = self.daemon.file("go")

    def jobs(self, link):
        return body(link.ask("PULL self:cles/jobs"))["jobs"]

    def states(self, link):
        return [job["state"] for job in self.jobs(link)]

    def begin(self, link, count):
        """Jobs that end when the file is there."""
        for number in range(1, count + 1):
            link.send(f"DELEGATE sat1:waits/{self.go.replace('/', '%2F')} id={number} deadline=60000")

    def test_jobs_that_run_and_jobs_that_wait(self):
        with self.daemon.connect() as link, self.daemon.connect() as other:
            self.assertEqual(self.jobs(other), [])
            self.begin(link, 3)
            wait_until(lambda: self.states(other) == ["running", "running", "queued"], "two workers have a job")
            first, second, third = self.jobs(other)
            self.assertLess(first["job"], second["job"])
            self.assertEqual((first["verb"], first["task"]), ("DELEGATE", "waits"))
            self.assertTrue(first["requester"].startswith("tcp://127.0.0.1:"), first)
            self.assertTrue(0 < third["deadline_ms"] <= 60000, third)
            self.daemon.write("", "go")
            self.assertEqual({body(link.read())["value"] for _ in range(3)}, {"found"})
            wait_until(lambda: self.jobs(other) == [], "none is left")
            times = body(other.ask("PULL self:cles/metrics"))["tasks_us"]["waits"]["DELEGATE"]
            self.assertEqual(times["samples"], 3)
            self.assertLessEqual(times["p50"], times["p99"])

    def test_any_of_them_is_cancelled(self):
        with self.daemon.connect() as link, self.daemon.connect() as other:
            self.begin(link, 3)
            wait_until(lambda: self.states(other) == ["running", "running", "queued"], "two workers have a job")
            running, _, waiting = self.jobs(other)
            for job, number in ((waiting, 3), (running, 1)):
                self.assertEqual(other.ask(f"PUSH self:cles/jobs/{job['job']}/cancel"), "{}")
                answer = link.read()
                self.assertTrue(answer.startswith(f"id={number} "), answer)
                self.assertEqual(body(answer), {"error": "cancelled", "message": "sat1: the job was cancelled on this host"})
            wait_until(lambda: self.states(other) == ["running"], "one is left")
            again = body(other.ask(f"PUSH self:cles/jobs/{waiting['job']}/cancel"))
            self.assertEqual(again, {"error": "no_task", "message": f"sat1 has no job {waiting['job']}"})
            self.daemon.write("", "go")
            self.assertEqual(body(link.read()), {"value": "found"})

    def test_what_does_not_stop_is_seen(self):
        with self.daemon.connect() as link, self.daemon.connect() as other:
            link.send("DELEGATE sat1:never_ends id=1 deadline=60000")
            wait_until(lambda: self.states(other) == ["running"], "it runs")
            link.send("PUSH self:cles/cancel/1 reply=no")
            self.assertEqual(body(link.read())["error"], "cancelled")
            (job,) = self.jobs(other)
            self.assertEqual(job["state"], "stopping")
            self.assertNotIn("deadline_ms", job)


if __name__ == "__main__":
    unittest.main()
