#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the part of the demonstration that shows security: to its end, and if it cannot work.

    demo_secured_test.py SCRIPT FOLDER

FOLDER is where the programs are.
"""

import sys
import unittest

from demo_case import DemoCase


class Demo(DemoCase):
    def test_it_shows_what_it_promises(self):
        code, said, complaint = self.show(CLES_AT="nonsense", CLES_KEYS="nowhere")
        self.assertEqual((code, complaint), (0, ""), said)
        for name in ("car1", "car2"):
            self.assertRegex(said, rf"(?m)^  {name} listening on tls://127\.0\.0\.1:\d+$")
        self.assertIn('{"parameters":["hello"]}', said)
        self.assertEqual(said.count("the other end refuses this node"), 2)

    def test_a_node_that_cannot_start_is_said(self):
        self.check_failure("cles", "car1 did not start", first="[ $1 = serve ] || exit 0\n")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
