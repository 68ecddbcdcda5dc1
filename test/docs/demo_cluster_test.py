#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the part of the demonstration that shows a cluster: to its end, interrupted, and if it cannot work. It never
leaves processes or files behind.

    demo_cluster_test.py SCRIPT FOLDER

FOLDER is where `clesd` and `cles` are.
"""

import re
import signal
import sys
import threading
import unittest
from pathlib import Path

from demo_case import SCRIPT, DemoCase

sys.path.insert(0, str(Path(SCRIPT).parent))
import demo_cluster  # noqa: E402


class Demo(DemoCase):
    def test_it_shows_what_it_promises(self):
        # Without the variables for daemons and commands in the user's own environment.
        code, said, complaint = self.show(CLES_LISTEN="tcp://127.0.0.1:1", CLES_SEEDS="nonsense", CLES_AT="nonsense")
        self.assertEqual((code, complaint), (0, ""), said)
        for name in ("sat1", "sat2", "sat3", "sat4"):
            self.assertRegex(said, rf"(?m)^  {name} listening on tcp://127\.0\.0\.1:\d+$")
            self.assertRegex(said, rf"(?m)^  {name} +live +\d+/2 .* primes \(DELEGATE\)")
            self.assertRegex(said, rf"(?m)^  {name} +[1-9]\d* #+$")
        self.assertRegex(said, r"(?m)^  80 sent: 80 done, 0 refused, 0 failed, 0 unknown, in \d+\.\d s$")
        answered = re.search(r"(?m)^  < (\{\"results\".*)$", said)[1]
        self.assertIn('"errors":{"sat1":{"error":"unavailable"', answered)
        self.assertRegex(said, r"(?m)^  After \d+\.\d s, car1 has a route to car4\.")
        self.assertIn('< {"value":true}', said)
        for name in ("car1", "car2", "car3"):
            self.assertRegex(said, rf"(?m)^  {name} +[1-9]\d* #+$")
        self.assertRegex(said, r"(?m)^  60 done in \d+\.\d s\. Jobs that waited at car2 moved to its neighbours")

    def test_interrupted_it_cleans_up(self):
        self.check_interrupts(((signal.SIGINT, "sat1 listening"), (signal.SIGTERM, "sat1 is dead")), "Which nodes reply")

    def test_it_ends_what_an_interrupted_wait_has_left(self):
        cluster = demo_cluster.Cluster("/bin")
        killed, running = cluster.begin("sleep", "60"), cluster.begin("sleep", "60")
        killed.kill()
        killed._waitpid_lock.acquire()  # an exception of a signal's handler may leave it held
        closing = threading.Thread(target=cluster.close, daemon=True)
        closing.start()
        closing.join(20)
        self.assertFalse(closing.is_alive())
        self.assertIsNotNone(running.poll())
        self.assertFalse(Path(cluster.folder).exists())

    def test_a_daemon_that_cannot_start_is_said(self):
        self.check_failure("clesd", "sat1 did not start")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
