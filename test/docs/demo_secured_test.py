#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the part of the demonstration that shows security: to its end, and if it cannot work.

    demo_secured_test.py SCRIPT FOLDER

FOLDER is where the programs are.
"""

import os
import subprocess
import sys
import tempfile
import unittest

SCRIPT, PROGRAMS = sys.argv[1], sys.argv[2]


class Demo(unittest.TestCase):
    def show(self, programs, **more):
        """Exit code, stdout and stderr. No files are left behind."""
        with tempfile.TemporaryDirectory() as files:
            done = subprocess.run([sys.executable, "-B", SCRIPT, programs], stdin=subprocess.DEVNULL,
                                  capture_output=True, text=True, timeout=100, check=False,
                                  env={**os.environ, "TMPDIR": files, **more})
            self.assertEqual(os.listdir(files), [])
        return done.returncode, done.stdout, done.stderr

    def test_it_shows_what_it_promises(self):
        code, said, complaint = self.show(PROGRAMS, CLES_AT="nonsense", CLES_KEYS="nowhere")
        self.assertEqual((code, complaint), (0, ""), said)
        for name in ("car1", "car2"):
            self.assertRegex(said, rf"(?m)^  {name} listening on tls://127\.0\.0\.1:\d+$")
        self.assertIn('{"parameters":["hello"]}', said)
        self.assertEqual(said.count("the other end refuses this node"), 2)

    def test_a_node_that_cannot_start_is_said(self):
        with tempfile.TemporaryDirectory() as folder:
            fake = os.path.join(folder, "cles")
            with open(fake, "w", encoding="utf-8") as out:
                out.write("#!/bin/sh\n[ $1 = serve ] || exit 0\necho no such luck >&2\nexit 1\n")
            os.chmod(fake, 0o755)
            code, _, complaint = self.show(folder)
        self.assertEqual((code, complaint), (1, "cles: car1 did not start: no such luck\n\n"))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
