#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Two daemons of one name: the second stops and reports the first, unless it is allowed to continue."""

import contextlib
import signal
import time
import unittest

from daemon import DEFAULTS, STUBBORN, Daemon, body, wait_until_running
from support import free_port, wait_until


class Clash(unittest.TestCase):
    def setUp(self):
        self.base = DEFAULTS.replace("multicast: off", f"multicast: {{interface: lo, port: {free_port()}}}")
        self.first = self.daemon()
        time.sleep(1.1)  # nodes that start within a second count as simultaneous

    def daemon(self, more=""):
        made = Daemon(more, base=self.base)
        self.addCleanup(made.__exit__)
        made.__enter__()
        return made

    def test_the_second_stops_with_a_reason(self):
        second = self.daemon()
        code, took = second.end()
        self.assertEqual(code, 3)
        self.assertLess(took, 10)
        entry = second.wait_for_entry("stopping: ")
        self.assertEqual(entry["level"], "error")
        self.assertIn(f"the node at {self.first.url} had the name 'sat1' first", entry["message"])
        self.assertIsNone(self.first.process.poll())
        peers = self.first.ask("PULL self:cles/peers")
        self.assertEqual(body(peers)["peers"], [])

    @contextlib.contextmanager
    def giving_way_with_a_job(self, drain):
        """A second one that stops while it runs a job, because a seed that is added later tells it of the first."""
        text = f"plugins: [{STUBBORN}]\ndrain: {drain}\n"
        second = Daemon(text, base=DEFAULTS)
        self.addCleanup(second.__exit__)
        with second.connect() as link:
            link.send("DELEGATE self:never_ends id=1 deadline=600000")
            wait_until_running(second, 1)
            second.write(DEFAULTS + text + f"seeds: [{self.first.url}]\n")
            second.send_signal(signal.SIGHUP)
            second.wait_for_entry("stopping: ")
            yield second

    def test_a_signal_while_it_stops_counts_as_the_first(self):
        with self.giving_way_with_a_job("3s") as second:
            signalled = time.monotonic()
            code, _ = second.stop()
            self.assertGreater(time.monotonic() - signalled, 2)
        self.assertEqual(code, 3)
        second.wait_for_entry("SIGTERM: already stopping")
        self.assertNotIn("on a second signal", second.log())

    def test_a_second_signal_stops_it_at_once(self):
        with self.giving_way_with_a_job("10min") as second:
            second.send_signal(signal.SIGTERM)
            second.wait_for_entry("SIGTERM: already stopping")
            self.assertEqual(second.stop()[0], 3)

    def test_it_continues_if_allowed(self):
        second = self.daemon("allow_clash: true\n")
        second.wait_for_entry("is already in use: the node at " + self.first.url)
        wait_until(lambda: '"clash"' in self.first.ask("PULL self:cles/peers"), "the first knows of it")
        self.assertIsNone(second.process.poll())
        for each in (self.first, second):
            self.assertEqual(each.stop()[0], 0)

    def test_another_pool_has_no_conflict(self):
        second = self.daemon("pool: north\n")
        wait_until(lambda: body(second.ask("PULL self:cles/metrics"))["announcements_foreign"] > 2, "the first is heard")
        self.assertIsNone(second.process.poll())
        self.assertEqual(body(second.ask("PULL self:cles/peers"))["peers"], [])
        self.assertEqual(body(self.first.ask("PULL self:cles/peers"))["peers"], [])


if __name__ == "__main__":
    unittest.main()
