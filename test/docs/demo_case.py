# SPDX-License-Identifier: BSL-1.0
"""Shared by the tests of the parts of the demonstration: runs one, and checks that it leaves nothing behind. Their arguments
are SCRIPT FOLDER, where FOLDER contains the programs."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import unittest
from pathlib import Path

SCRIPT, PROGRAMS = sys.argv[1], sys.argv[2]
BOUND = 100  # seconds; each takes a few


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


class DemoCase(unittest.TestCase):
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

    def check_interrupts(self, interrupts, later):
        """`interrupts` are signals, and the words at which each is sent: it ends at once, without having said `later`."""
        for number, at in interrupts:
            code, said, complaint = self.show(interrupt=number, at=at)
            self.assertEqual((code, complaint), (128 + number, ""), said)
            self.assertNotIn(later, said)

    def check_failure(self, program, complaint, first=""):
        """A program that cannot work is reported. `first` is what it does before, in shell."""
        fake = self.folder / program
        fake.write_text(f"#!/bin/sh\n{first}echo no such luck >&2\nexit 1\n", encoding="utf-8")
        fake.chmod(0o755)
        code, _, said = self.show(str(self.folder))
        self.assertEqual((code, said), (1, f"cles: {complaint}: no such luck\n\n"))
