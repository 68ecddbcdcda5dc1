# SPDX-License-Identifier: BSL-1.0
"""What the tests of keys, fleets and rights share: a folder of their own, in which the commands run."""

import json
import subprocess
import tempfile
import unittest
from collections import namedtuple
from pathlib import Path

from support import CLES, PATIENCE, environment

Done = namedtuple("Done", "code out err")


class Trust(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.scratch = Path(scratch.name)

    def path(self, *parts):
        return self.scratch.joinpath(*parts)

    def run_in(self, *arguments, stdin="", env=None):
        done = subprocess.run([CLES, *arguments], input=stdin, capture_output=True, text=True, env=env or environment(),
                              cwd=self.scratch, timeout=PATIENCE, check=False)
        return Done(done.returncode, done.stdout, done.stderr)

    def good(self, *arguments, **options):
        done = self.run_in(*arguments, **options)
        self.assertEqual(done.code, 0, (arguments, done))
        return done

    def json(self, *arguments):
        return json.loads(self.good(*arguments, "-o", "json").out)

    def ends_with(self, code, *arguments, says, **options):
        done = self.run_in(*arguments, **options)
        self.assertEqual((done.code, done.out), (code, ""), (arguments, done))
        self.assertTrue(done.err.startswith("cles: "), done.err)
        self.assertIn(says, done.err, arguments)

    def failed(self, *arguments, **options):
        self.ends_with(1, *arguments, **options)

    def refused(self, *arguments, **options):
        self.ends_with(2, *arguments, **options)

    def fleet(self):
        """A new fleet in the folder `fleet`."""
        self.good("fleet", "init", "fleet")
        return self.fleet_of("fleet")

    def fleet_of(self, folder):
        return self.json("fleet", "show", "-k", folder)

    def joined(self, *names):
        """A fleet with these members, each in a folder of its name."""
        self.fleet()
        for name in names:
            if not self.path(name).exists():
                self.good("keys", "new", name, "-k", name)
        self.good("fleet", "add", *(f"{name}/{name}.pub" for name in names), "--may", "all", "-k", "fleet")
        for name in names:
            self.good("keys", "join", f"fleet/{name}.join", "-k", name)
