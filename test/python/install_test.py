#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Wheel and source archive: built, installed by pip without a network, used; equal when built again."""

import hashlib
import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROJECT = Path(__file__).parents[2]
# What another project's settings could change: pip asks nobody.
OFFLINE = {key: value for key, value in os.environ.items() if not key.startswith(("PIP_", "PYTHONPATH"))} | {
    "PIP_NO_INDEX": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_CONFIG_FILE": os.devnull, "PYTHONDONTWRITEBYTECODE": "1"}


class Install(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.scratch = Path(scratch.name)

    def run_it(self, *command, **options):
        done = subprocess.run(command, capture_output=True, text=True, env=OFFLINE, check=False, **options)
        self.assertEqual(done.returncode, 0, (command, done.stdout, done.stderr))
        return done.stdout

    def build(self, folder="dist"):
        out = self.run_it(sys.executable, "-B", PROJECT / "python" / "build_wheel.py", self.scratch / folder)
        return [Path(line) for line in out.splitlines()]

    def test_they_are_reproducible(self):
        digests = [[hashlib.sha256(path.read_bytes()).hexdigest() for path in self.build(folder)] for folder in ("a", "b")]
        self.assertEqual(*digests)

    def test_the_version_is_that_of_the_library(self):
        header = (PROJECT / "libcles/include/cles/version.hpp").read_text(encoding="utf-8")
        wheel = self.build()[0]
        self.assertIn(f'version = "{wheel.name.split("-")[1]}"', header)

    def test_pip_installs_both_without_a_network(self):
        if importlib.util.find_spec("pip") is None:
            self.skipTest("this Python has no pip (package python3-pip)")
        wheel, archive = self.build()
        for number, package in enumerate((wheel, archive)):
            place = self.scratch / f"place{number}"
            self.run_it(sys.executable, "-m", "pip", "install", "--no-index", "--target", place, package, cwd=self.scratch)
            self.assertTrue((place / "cles" / "py.typed").exists())
            self.assertTrue(list(place.glob("cles-*.dist-info/LICENSE")))
            out = self.run_it(sys.executable, "-c", "import sys; sys.path.insert(0, sys.argv[1]); import cles; "
                              "print(cles.__file__, cles.Node('x').name)", place, cwd=self.scratch)
            self.assertEqual(out, f"{place}/cles/__init__.py x\n")


if __name__ == "__main__":
    unittest.main()
