#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A few exchanges, tasks and publications with a peer, by each of its carriers: checks that it works, not how fast.

    peers_smoke_test.py PROGRAM
"""

import json
import subprocess
import sys
import unittest

PROGRAM = sys.argv[1]
NOT_OFFERED = 77


def run(*arguments):
    return subprocess.run([PROGRAM, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
                          timeout=60)


class Peer(unittest.TestCase):
    def setUp(self):
        about = run("--about")
        self.assertEqual(about.returncode, 0, about.stderr)
        self.about = json.loads(about.stdout)
        self.assertTrue(self.about["version"] and self.about["settings"])

    def measured(self, *arguments):
        """By each carrier that offers it, which is at least one."""
        found = []
        for over in self.about["carriers"].split():
            with self.subTest(over=over, arguments=arguments):
                done = run("--over", over, *arguments)
                if done.returncode == NOT_OFFERED:
                    self.assertIn("not offered: ", done.stderr)
                    continue
                self.assertEqual(done.returncode, 0, done.stderr)
                found.append(json.loads(done.stdout))
                self.assertEqual(found[-1]["over"], over)
        return found

    def check(self, runs, count):
        self.assertTrue(runs)
        for each in runs:
            self.assertEqual(each["count"], count)
            self.assertGreater(each["p50_us"], 0)
            self.assertGreaterEqual(each["p99_us"], each["p50_us"])
            self.assertGreater(each["per_s"], 0)
            self.assertGreater(each["cpu_us"], 0)
            self.assertGreater(min(each["memory_kib"].values()), 0)
            self.assertEqual({"client", "server"} - set(each["memory_kib"]), set())
            self.assertFalse([name for name in each["libraries"] if name.startswith(("libc.", "libstdc++."))])

    def test_exchanges_one_by_one_and_many_at_once(self):
        self.check(self.measured("--mode", "exchange", "--count", "50"), 50)
        self.check(self.measured("--mode", "exchange", "--count", "500", "--in-flight", "64"), 500)

    def test_tasks_one_by_one_and_many_at_once(self):
        self.check(self.measured("--mode", "task", "--count", "50"), 50)
        self.check(self.measured("--mode", "task", "--count", "500", "--in-flight", "64"), 500)

    def test_fewer_calls_than_may_be_in_flight(self):
        self.check(self.measured("--mode", "exchange", "--count", "3", "--in-flight", "8"), 3)

    def test_publications_reach_all_subscribers(self):
        for each in self.measured("--mode", "fanout", "--subscribers", "3", "--count", "50"):
            if each["over"] in ("udp", "multicast"):  # which may lose some on a busy machine
                self.assertLess(each["lost"], 1)
            else:
                self.assertEqual(each["lost"], 0)
            self.check([each], round(150 * (1 - each["lost"])))

    def test_bad_input_is_refused_with_words(self):
        for wrong in (["--mode", "dance"], ["--over", "pigeon"], ["--count", "0"], ["--in-flight"], ["--what"]):
            done = run(*wrong)
            self.assertEqual(done.returncode, 2, wrong)
            self.assertIn("cles_peer: ", done.stderr)
        self.assertEqual(run("--help").returncode, 0)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
