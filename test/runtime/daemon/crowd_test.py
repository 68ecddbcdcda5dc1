#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A daemon that receives announcements of a thousand unreachable nodes still answers in time, and becomes idle."""

import os
import time
import unittest

from daemon import DEFAULTS, Daemon, body
from fakes import Fakes
from support import free_port, wait_until

COUNT = 1024
TICKS = os.sysconf("SC_CLK_TCK")
# Sanitizers make the work several times as long.
SLOWER = 4 if os.environ.get("SANITIZED", "") else 1


def processor_time(process):
    """The processor time that it has used, in seconds, in user and system mode."""
    with open(f"/proc/{process.pid}/stat", encoding="utf-8") as stat:
        fields = stat.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


class Crowd(unittest.TestCase):
    def setUp(self):
        self.port = free_port()
        group = f"multicast: {{interface: lo, port: {self.port}}}"
        base = DEFAULTS.replace("multicast: off", group).replace("level: debug", "level: warning")
        self.one = self.enterContext(Daemon(base=base))
        self.other = self.enterContext(Daemon(base=base.replace("sat1", "sat2")))
        self.fakes = self.enterContext(Fakes(self.port, COUNT))
        self.link = self.enterContext(self.one.connect())
        wait_until(lambda: self.known() == 1, "they know each other")

    if not hasattr(unittest.TestCase, "enterContext"):  # Python 3.11 brings it

        def enterContext(self, held):  # noqa: N802
            made = held.__enter__()
            self.addCleanup(held.__exit__, None, None, None)
            return made

    def known(self):
        return len(body(self.link.ask("PULL self:cles/peers"))["peers"])

    def announce(self):
        for first in range(0, COUNT, 64):  # as many as a socket's buffer takes
            self.fakes.announce(self.fakes.nodes[first:first + 64])
            time.sleep(0.002)

    def slowest(self, seconds):
        """The 99th percentile of requests in the quietest of three spans of time: other work of the machine disturbs some
        of them, what the dead names cost is in each."""
        return min(self.slowest_of_span(seconds / 3) for _ in range(3))

    def slowest_of_span(self, seconds):
        """The 99th percentile of requests to one node and through it to the other, in milliseconds."""
        spans = []
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for noun in ("sat1:cles/metrics", "sat2:cles/metrics"):
                begun = time.perf_counter()
                self.assertNotIn('"error"', self.link.ask(f"PULL {noun}")[:10])
                spans.append((time.perf_counter() - begun) * 1000)
        return sorted(spans)[len(spans) * 99 // 100]

    def ask_all(self, deadline):
        begun = time.monotonic()
        answer = body(self.link.ask(f"PULL all:cles deadline={deadline}"))
        return answer, time.monotonic() - begun

    def test_a_thousand_unreachable_nodes_do_not_slow_a_node(self):
        before = self.slowest(6)
        self.announce()
        wait_until(lambda: self.known() > COUNT * 9 // 10, "most of them are known")
        beside = self.slowest(6)
        asked = {deadline: self.ask_all(deadline) for deadline in (300 * SLOWER, 1000 * SLOWER)}
        begun, worked = time.monotonic(), processor_time(self.one.process)
        time.sleep(5)
        share = (processor_time(self.one.process) - worked) / (time.monotonic() - begun)
        print(f"99 of 100 requests within {before:.2f} ms, beside {COUNT} dead names {beside:.2f} ms; "
              f"at rest {share:.1%} of a core; all: " + ", ".join(f"{took:.2f} s of {deadline} ms" for deadline, (_, took) in asked.items()))
        for deadline, (answer, took) in asked.items():
            self.assertIn("sat2", answer.get("results", {}), answer.get("message"))
            self.assertLess(took, deadline / 1000)
        self.assertLessEqual(beside, 2 * before + SLOWER)
        self.assertLessEqual(share, 0.05 * SLOWER)


if __name__ == "__main__":
    unittest.main()
