#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Every recorded conversation of version 1, held with the Python package."""

import unittest
from pathlib import Path

from conversation import fits, replay

GOLDEN = Path(__file__).parents[1] / "golden"


class Golden(unittest.TestCase):
    def test_it_talks_as_nodes_always_did(self):
        scripts = sorted(GOLDEN.glob("*.txt"))
        self.assertGreaterEqual(len(scripts), 32)
        for script in scripts:
            with self.subTest(script.name):
                self.assertEqual(replay(script.read_text(encoding="utf-8")), [])


class Replay(unittest.TestCase):
    """The judge, judged."""

    def test_what_differs_is_said(self):
        self.assertEqual(replay('> PULL car1:speed\n< {"v":27.5}\n'), [])
        self.assertEqual(replay('> PULL car1:speed\n< {"v":3}\n'),
                         ["line 2: expected '< {\"v\":3}', there came '< {\"v\":27.5}'"])
        self.assertEqual(replay("> PUSH car1:echo reply=no\n< {}\n"), ["line 2: expected '< {}', nothing came"])
        self.assertEqual(replay("> PULL car1:speed\n"), ["line 1: nobody expected '< {\"v\":27.5}'"])
        self.assertEqual(replay('b> PULL car1:speed\n< {"v":27.5}\n'),
                         ["line 2: expected '< {\"v\":27.5}', there came 'b< {\"v\":27.5}'"])

    def test_a_script_that_makes_no_sense_is_no_success(self):
        self.assertEqual(replay(""), ["nothing happens"])
        self.assertEqual(replay("@ dance\n"), ["line 1: there is no step '@ dance'"])
        self.assertEqual(replay("@ done lunch {}\n"), ["line 1: no handler of 'lunch' runs"])

    def test_three_dots_stand_for_anything(self):
        for pattern, text, expected in (("abc", "abc", True), ("abc", "abcd", False), ("a...", "a", True),
                                        ("...b...", "abc", True), ("a...c", "abcd", False), ("ab...bc", "abc", False)):
            self.assertEqual(fits(pattern, text), expected, (pattern, text))


if __name__ == "__main__":
    unittest.main()
