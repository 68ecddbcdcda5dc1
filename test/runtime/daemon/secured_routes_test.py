#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Routes over several hops in a secured fleet: the line and the ring of `routes_test.py`, whose nodes are members, and
forward as far as they have the right to."""

import json
import os
import shutil
import time
import unittest

import routes_test
from daemon import PLUGINS, STUBBORN
from secured import Fleet
from support import wait_until


class Secured(routes_test.Network):
    """All nodes may forward for all."""

    @classmethod
    def make_fleet(cls, opened):
        fleet = opened.enter_context(Fleet(*cls.NAMES))
        fleet.let_forward(*cls.NAMES)
        fleet.spread(*cls.NAMES)
        # Nobody but the user may be able to change plugins.
        fleet.plugins = fleet.file("plugins")
        os.mkdir(fleet.plugins, 0o755)
        for file in (STUBBORN, f"{PLUGINS}/libcles-primes.so", f"{PLUGINS}/libcles-system.so"):
            os.chmod(shutil.copy(file, fleet.plugins), 0o644)
        return fleet


class SecuredLine(Secured, routes_test.Topology, unittest.TestCase):
    NAMES, CABLES = routes_test.Line.NAMES, routes_test.Line.CABLES
    NEAR, FAR = routes_test.Line.NEAR, routes_test.Line.FAR


class SecuredRing(Secured, routes_test.RingTests, unittest.TestCase):
    NAMES, CABLES = routes_test.RingTests.NAMES, routes_test.RingTests.CABLES
    NEAR, FAR = routes_test.RingTests.NEAR, routes_test.RingTests.FAR
    HAS_LINKS = True

    def test_a_node_that_may_not_forward_is_not_on_the_way(self):
        self.assertEqual(self.route("n1", "n3"), (2, "n2"))
        try:
            self.fleet.let_forward("n2", who="none")
            self.fleet.spread("n4")
            begun = time.monotonic()
            wait_until(lambda: self.route("n1", "n3") == (3, "n5"), "n1 has another route")
            self.say(f"another route {time.monotonic() - begun:.2f} s after n4 has got the new roster")
            for other in ("n2", "n3"):
                self.assertEqual(json.loads(self.nodes["n1"].ask(f"PULL {other}:cles"))["node"], other)
        finally:
            self.fleet.let_forward("n2")
            self.fleet.spread("n4")
            self.wait_for_routes(self.CABLES, "with the right again", time.monotonic())

    def route(self, one, other):
        """The number of links, and the neighbour."""
        (found,) = [peer for peer in self.nodes[one].peers() if peer["node"] == other]
        return found.get("hops", 1), found.get("via")


if __name__ == "__main__":
    unittest.main()
