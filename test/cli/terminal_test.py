#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""What is shown only on a terminal: tables, colours, progress, Ctrl-C."""

import unittest

from support import NodeTest, environment, on_terminal


class Terminal(NodeTest):
    def show(self, *arguments, **options):
        return on_terminal(*arguments, "--at", self.node.url, **options)

    def test_tables_are_the_default(self):
        code, shown = self.show("push", "car1:echo", "-d", '{"a":1,"bc":"x"}', env=environment(NO_COLOR="1"))
        self.assertEqual((code, shown), (0, "a   1\r\nbc  x\r\n"))

    def test_colours(self):
        code, shown = self.show("push", "car1:echo", "-d", '{"a":1}')
        self.assertEqual((code, shown), (0, "\x1b[1ma\x1b[0m  1\r\n"))
        code, shown = self.show("pull", "car1:nothing")
        self.assertEqual(code, 3)
        self.assertTrue(shown.startswith("\x1b[31mcles:\x1b[0m no_task: "), shown)

    def test_no_colour_where_it_is_not_wanted(self):
        for env in (environment(NO_COLOR="1"), environment(TERM="dumb")):
            for arguments in (("push", "car1:echo", "-d", '{"a":1}'), ("pull", "car1:nothing"), ("info", "-v")):
                _, shown = self.show(*arguments, env=env)
                self.assertNotIn("\x1b", shown)
        _, shown = self.show("push", "car1:echo", "-d", '{"a":1}', env=environment(NO_COLOR=""))
        self.assertIn("\x1b[1m", shown)

    def test_progress_is_one_line_that_goes(self):
        code, shown = self.show("delegate", "car1:sleep/50", "-o", "json")
        self.assertEqual(code, 0)
        self.assertIn("\r\x1b[K[###...........................] 10%", shown)
        self.assertTrue(shown.endswith('\r\x1b[K{"slept_ms":50}\r\n'), shown)

    def test_ctrl_c_ends_a_feed(self):
        code, shown = self.show("bind", "car1:localization", interrupt_after=b"\n")
        self.assertEqual(code, 130)
        self.assertNotIn("cles:", shown)

    def test_ctrl_c_withdraws_a_task(self):
        code, shown = self.show("delegate", "car1:sleep/20000", interrupt_after=b"10%")
        self.assertEqual(code, 130)
        self.assertTrue(shown.endswith("\r\x1b[K"), shown)


if __name__ == "__main__":
    unittest.main()
