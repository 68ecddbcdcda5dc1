#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the part of the demonstration that joins two pools: to its end, and interrupted. It never leaves processes or files
behind.

    demo_federation_test.py SCRIPT FOLDER

FOLDER is where `clesd` and `cles` are.
"""

import signal
import sys
import unittest

from demo_case import DemoCase


class Demo(DemoCase):
    def test_it_shows_what_it_promises(self):
        code, said, complaint = self.show()
        self.assertEqual((code, complaint), (0, ""), said)
        self.assertIn('> PULL north.car1:prime/97\n  < {"value":true}', said)
        self.assertRegex(said, r"hub +north +live +1 +2")
        self.assertIn('"error":"unavailable"', said)
        self.assertRegex(said, r"[0-9.]+ s after the server was started again, requests cross it\.")

    def test_it_leaves_nothing_behind_when_it_is_interrupted(self):
        code, _, _ = self.show(interrupt=signal.SIGTERM, at="kill -9 for nats-server")
        self.assertEqual(code, 128 + signal.SIGTERM)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
