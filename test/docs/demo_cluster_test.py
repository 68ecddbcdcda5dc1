#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the part of the demonstration that shows a cluster: to its end, interrupted, and if it cannot work. It never
leaves processes or files behind.

    demo_cluster_test.py SCRIPT FOLDER

FOLDER is where `clesd` and `cles` are.
"""

import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import unittest
from pathlib import Path

SCRIPT, PROGRAMS = sys.argv[1], sys.argv[2]
BOUND = 100  # seconds; it takes about two


def members_of(session):
    """The processes of a session, except those that have ended and have not been waited for."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            text = stat.read_text()
        except OSError:  # it has ended meanwhile
            continue
        state, _, _, its_session = text.rpartition(")")[2].split()[:4]
        if int(its_session) == session and state != "Z":
            found.append(text.partition(" (")[2].partition(")")[0])
    return found


class Demo(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def show(self, programs=PROGRAMS, interrupt=None, at="", **more):
        """Exit code, stdout and stderr; with a signal as soon as a line with those words has been read."""
        files = self.folder / "files"
        files.mkdir(exist_ok=True)
        with tempfile.TemporaryFile("w+") as errors:
            demo = subprocess.Popen([sys.executable, "-B", SCRIPT, programs], stdin=subprocess.DEVNULL,
                                    stdout=subprocess.PIPE, stderr=errors, text=True, start_new_session=True,
                                    env={**os.environ, "TMPDIR": str(files), **more})
            watchdog = threading.Timer(BOUND, os.killpg, (demo.pid, signal.SIGKILL))
            watchdog.start()
            said = ""
            for line in demo.stdout:
                said += line
                if interrupt and at in line:
                    demo.send_signal(interrupt)
                    interrupt = None
            code = demo.wait()
            watchdog.cancel()
            demo.stdout.close()
            errors.seek(0)
            complaint = errors.read()
        self.assertEqual(members_of(demo.pid), [], "processes that it left behind")
        self.assertEqual(list(files.iterdir()), [], "files that it left behind")
        return code, said, complaint

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
        for number, at in ((signal.SIGINT, "sat1 listening"), (signal.SIGTERM, "sat1 is dead")):
            code, said, complaint = self.show(interrupt=number, at=at)
            self.assertEqual((code, complaint), (128 + number, ""), said)
            self.assertNotIn("Which nodes reply", said)

    def test_a_daemon_that_cannot_start_is_said(self):
        fake = self.folder / "clesd"
        fake.write_text("#!/bin/sh\necho no such luck >&2\nexit 1\n", encoding="utf-8")
        fake.chmod(0o755)
        code, _, complaint = self.show(str(self.folder))
        self.assertEqual((code, complaint), (1, "cles: sat1 did not start: no such luck\n\n"))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
