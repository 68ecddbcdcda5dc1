#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the part of the demonstration that shows the case studies: to its end, interrupted, and if it cannot work.

    demo_case_studies_test.py SCRIPT FOLDER

FOLDER is where the programs are.
"""

import os
import signal
import sys
import unittest

from demo_case import PROGRAMS, DemoCase


class Demo(DemoCase):
    def test_it_shows_what_it_promises(self):
        code, said, complaint = self.show(CLES_AT="nonsense", CLES_KEYS="nowhere")
        self.assertEqual((code, complaint), (0, ""), said)
        self.assertRegex(said, r"(?m)^    gap +\d+\.\d{3} m at least$")
        self.assertRegex(said, r"(?m)^  mission: order mission-\d+-1 is released by strike1, 3 weapons left$")
        for member in ("recon", "operator"):
            self.assertIn(f"cles: denied: {member} may not send DELEGATE 'strike' to strike1", said)

    def test_interrupted_it_cleans_up(self):
        self.check_interrupts(((signal.SIGINT, "A platoon"), (signal.SIGTERM, "Joint command")), "mission:")

    def test_a_platoon_that_fails_is_said(self):
        self.check_failure("cles-platoon", "the platoon ended with 1")

    def test_programs_that_are_missing_are_said(self):
        self.assertTrue(os.path.exists(os.path.join(PROGRAMS, "cles-platoon")))
        code, _, complaint = self.show(str(self.folder))
        self.assertEqual(code, 1)
        self.assertIn("cles-platoon", complaint)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
