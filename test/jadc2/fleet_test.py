#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The script that runs joint command leaves nothing behind, even if it is stopped while it starts.

    fleet_test.py PROGRAMS
"""

import os
import select
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from jadc2_fleet import PATIENCE, Fleet, Namespaces
from story import namespaces

PROGRAMS = sys.argv[1]
SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "jadc2"


def ends(handle):
    """Whether that process ends; waits for it."""
    try:
        return bool(select.select([handle], [], [], PATIENCE)[0])
    finally:
        os.close(handle)


class LeavesNothing(unittest.TestCase):
    def test_a_daemon_that_is_not_ready_when_the_script_is_told_to_end(self):
        with tempfile.TemporaryDirectory() as folder:
            programs, files, told = Path(folder, "programs"), Path(folder, "files"), Path(folder, "told")
            programs.mkdir()
            files.mkdir()
            os.mkfifo(told)
            for name in ("clesd", "cles", "cles-jadc2"):  # prints nothing, like a process that hangs
                (programs / name).write_text(f"#!/bin/sh\necho $$ > {told}\nexec sleep 300\n", encoding="utf-8")
                (programs / name).chmod(0o755)
            reader = os.open(told, os.O_RDONLY | os.O_NONBLOCK)
            with subprocess.Popen([sys.executable, "-B", SCRIPT, "--programs", programs], stdin=subprocess.DEVNULL,
                                  stdout=subprocess.DEVNULL, env={**os.environ, "TMPDIR": str(files)}) as script:
                self.assertTrue(select.select([reader], [], [], PATIENCE)[0], "no daemon was started")
                daemon = os.pidfd_open(int(os.read(reader, 100)))
                os.close(reader)
                script.send_signal(signal.SIGTERM)
                self.assertEqual(script.wait(PATIENCE), 130)
            self.assertTrue(ends(daemon))
            self.assertEqual(list(files.iterdir()), [])

    def test_namespaces_that_are_interrupted(self):
        keepers = []

        class Interrupted(Namespaces):
            def _ip(self, role, *words):
                keepers.extend(keeper.pid for keeper in self.keepers.values())
                raise KeyboardInterrupt

        namespaces(self).close()
        with self.assertRaises(KeyboardInterrupt):
            Interrupted()
        self.assertNotEqual(keepers, [])
        for keeper in keepers:
            self.assertRaises(ProcessLookupError, os.kill, keeper, 0)

    def test_namespaces_whose_script_is_killed(self):
        namespaces(self).close()
        code = "import jadc2_fleet as f; n = f.Namespaces(); print(*(k.pid for k in n.keepers.values()), flush=True); input()"
        with subprocess.Popen([sys.executable, "-B", "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as script:
            keepers = [os.pidfd_open(int(pid)) for pid in script.stdout.readline().split()]
            script.kill()
        self.assertEqual(len(keepers), 5)
        self.assertTrue(all([ends(keeper) for keeper in keepers]))

    def test_its_folder(self):
        with Fleet(PROGRAMS) as fleet:
            fleet.satellite()
            self.assertTrue(os.path.isdir(fleet.folder))
        self.assertFalse(os.path.exists(fleet.folder))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
