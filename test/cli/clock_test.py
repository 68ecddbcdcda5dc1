#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Security without a wall clock (docs/security.md): what is set to 1970, or differs, is accepted and refused as ever."""

import json
import os
import re
import signal
import subprocess
import sys
import unittest

from support import PATIENCE, environment, finish, free_port, read_line, start
from trust_support import Trust

CLOCK = os.environ["CLOCK_1970"]
ECHO = '{"parameters":["7"]}\n'


def at(year):
    return {"LD_PRELOAD": CLOCK} if year == 1970 else {}


class Clock(Trust):
    """A fleet of car1 and operator, both of which may be in 1970."""

    def setUp(self):
        super().setUp()
        self.group = f"lo,239.255.0.8:{free_port()}"
        self.good("fleet", "init", "fleet", "--with", "car1,operator")

    def environment(self, year):
        return environment(CLES_MULTICAST=self.group, **at(year))

    def serve(self, year, port=0):
        """Starts car1 in that year; returns its process and its address."""
        process = start("serve", "-k", "fleet/car1", "-l", f"tls://127.0.0.1:{port}", "--rate", "0", cwd=self.scratch,
                        env=self.environment(year))
        found = re.fullmatch(r"car1 listening on (tls://127\.0\.0\.1:\d+)\n", read_line(process))
        self.assertTrue(found)
        return process, found[1]

    def end(self, process):
        process.send_signal(signal.SIGTERM)
        self.assertEqual(finish(process)[0], 0)

    def ask(self, year, *arguments):
        return self.run_in(*arguments, "-k", "fleet/operator", env=self.environment(year))

    def expect_reached(self, served, asked, where):
        """By TLS, and by the sealed datagrams of the group."""
        with self.subTest(served=served, asked=asked):
            self.assertEqual(self.ask(asked, "pull", "car1:echo/7", "--at", where), (0, ECHO, ""))
            found = json.loads(self.ask(asked, "ls", "-o", "json").out)["peers"]
            self.assertEqual([node["node"] for node in found], ["car1"])

    def test_it_is_1970_with_the_library(self):
        done = subprocess.run([sys.executable, "-c", "import time; print(int(time.time()))"], capture_output=True,
                              text=True, env=environment(**at(1970)), timeout=PATIENCE, check=True)
        self.assertEqual(done.stdout, "30\n")

    def test_members_reach_each_other_in_any_year(self):
        for served in (1970, 2026):
            process, where = self.serve(served)
            for asked in (1970, 2026):
                self.expect_reached(served, asked, where)
            self.end(process)

    def test_and_after_a_reboot_that_sets_the_clock_back(self):
        port = free_port()
        for served, asked in ((2026, 2026), (1970, 2026), (1970, 1970), (2026, 1970)):
            process, where = self.serve(served, port)
            self.expect_reached(served, asked, where)
            self.end(process)

    def test_a_member_that_was_removed_stays_so(self):
        self.good("fleet", "remove", "operator", "--keys", "fleet")
        self.good("keys", "join", "fleet/roster", "--keys", "fleet/car1")
        process, where = self.serve(1970)
        for asked in (1970, 2026):
            done = self.ask(asked, "pull", "car1:echo/7", "--at", where)
            self.assertNotEqual(done.code, 0)
            self.assertEqual(done.out, "")
            self.assertIn("refuses this node", done.err)
        self.end(process)


if __name__ == "__main__":
    unittest.main()
