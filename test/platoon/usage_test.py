#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""What `cles-platoon` says if something is missing or wrong, and how it shows a drive."""

import json
import os
import pty
import re
import select
import socket
import subprocess
import time
import unittest

from processes import PATIENCE, PLATOON, free_group, run, start, wait_until


class Usage(unittest.TestCase):
    def test_nobody_leads(self):
        group = free_group()
        code, out, err = run("vehicle", "--name", "v9", "--multicast", group)
        self.assertEqual((code, out), (3, ""))
        self.assertEqual(err, f"cles-platoon: there is no platoon: no vehicle was found in the group {group[3:]}\n")

    def test_nobody_can_be_watched(self):
        group = free_group()
        for options in ([], ["--json"]):
            self.assertEqual(run("watch", "--multicast", group, "--seconds", 2, *options),
                             (3, "",
                              f"cles-platoon: there is no platoon: no vehicle was found in the group {group[3:]}\n"))

    def test_the_one_ahead_is_not_there(self):
        code, out, err = run("vehicle", "--name", "v1", "--ahead", "v0", "--multicast", free_group(), "--seconds", 2)
        self.assertEqual((code, out), (0, ""))
        self.assertRegex(err, r"^ +1\.\d+ s  v1  fallback: v0 ahead was never received\n$")

    def test_the_port_is_taken(self):
        with socket.socket(type=socket.SOCK_DGRAM) as other:
            other.bind(("", 0))
            code, out, err = run("run", "--multicast", f"lo,239.255.25.37:{other.getsockname()[1]}")
        self.assertNotEqual(code, 0)
        self.assertEqual(out, "")
        self.assertRegex(err, r"^cles-platoon: .*239\.255\.25\.37.*[Aa]ddress already in use")

    def test_there_is_no_multicast(self):
        for where, said in (("nowhere0", "nowhere0"), ("off", "by multicast, which is off"), ("lo,1.2.3.4", "1.2.3.4")):
            code, out, err = run("run", "--multicast", where)
            self.assertNotIn(code, (0, 1), where)
            self.assertEqual(out, "")
            self.assertRegex(err, f"^cles-platoon: .*{re.escape(said)}")

    def test_there_can_be_no_namespaces(self):
        """Faults need one for each vehicle; without faults, nothing does."""
        limited = ["unshare", "--user", "--map-root-user", "sh", "-c",
                   'echo 0 >/proc/sys/user/max_net_namespaces && exec "$0" "$@"', PLATOON]
        for more, code, said in ((["--loss", "10"], 3, "cles-platoon: faults need a network namespace for each vehicle, and this "
                                                       "process may not create it: No space left on device\n"), ([], 4, "")):
            done = subprocess.run([*limited, "run", "--vehicles", "2", "--seconds", "1", "--multicast", free_group(), *more],
                                  stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE, check=False)
            if "max_net_namespaces" in done.stderr or done.stderr.startswith("unshare: "):
                self.skipTest("this system permits no user namespaces")
            self.assertEqual((done.returncode, done.stderr), (code, said))

    def test_another_platoon_is_there(self):
        group = free_group()
        other = start("vehicle", "--name", "v0", "--lead", "--multicast", group)
        try:
            tries = []

            def is_heard():
                tries.append(run("run", "--multicast", group, "--vehicles", 2, "--seconds", 1))
                return tries[-1][0] == 6

            wait_until(is_heard, "it is heard")
            self.assertEqual(tries[-1][2], "cles-platoon: another platoon uses this group (received v0): choose another port "
                                  "with --multicast\n")
        finally:
            other.terminate()
            other.communicate(timeout=PATIENCE)

    def test_wrong_usage(self):
        for arguments in ([], ["fly"], ["run", "--vanish", "x"], ["run", "--vanish", "99@1"], ["run", "--join", "0@1"],
                          ["run", "--hz", "5"], ["run", "--loss", "101"], ["simulate", "--vehicles", "1"],
                          ["simulate", "--vanish", "3@"], ["simulate", "--mute", "1@2+x"],
                          ["simulate", "--loss", "60", "--burst", "1.2"], ["simulate", "--no-radar", "--split", "1@2"],
                          ["simulate", "--lags", "0.5", "0.2"], ["vehicle"],
                          ["vehicle", "--name", "v1", "--lead", "--ahead", "v0"]):
            code, out, err = run(*arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertNotEqual(err, "", arguments)

    def test_a_drive_that_ends_before_the_manoeuvre_has_no_verdict(self):
        for seeds in (1, 2):
            code, out, err = run("simulate", "--seconds", 3, "--loss", 10, "--seeds", seeds)
            self.assertEqual((code, err), (4, ""))
            self.assertRegex(out, r"(?m)^ended     no: ")
            self.assertNotIn("failures", out)

    def test_a_platoon_that_stands_or_falls_apart_has_failed(self):
        code, out, err = run("simulate", "--loss", 100, "--no-radar", "--seeds", 2, "--vehicles", 4)
        self.assertEqual((code, err), (1, ""))
        self.assertIn("failures  2 of 2 drives above a string ratio of 1.02, or with vehicles that stand or are apart: ", out)
        code, out, err = run("simulate", "--loss", 100, "--no-radar", "--vehicles", 4)
        self.assertEqual((code, err), (1, ""))
        self.assertRegex(out, r"(?m)^stands    A VEHICLE STANDS")
        self.assertRegex(out, r"(?m)^apart     THE PLATOON FELL APART")

    def test_errors_that_are_only_noise_are_no_failures(self):
        code, out, err = run("simulate", "--vehicles", 100, "--loss", 10)
        self.assertEqual((code, err), (0, ""))
        self.assertLess(float(re.search(r"string ratio (\S+)", out)[1]), 1.02)

    def test_it_tells_the_gains_in_time_and_frequency(self):
        code, out, err = run("simulate", "--vehicles", 4, "--json")
        self.assertEqual((code, err), (0, ""))
        found = json.loads(out)
        for half in ("braking", "recovery"):
            self.assertEqual([len(found[half][what]) for what in ("error", "speed", "acceleration")], [2, 3, 3], half)
            self.assertGreater(found[half]["speed"][0], 0.9, half)
        code, out, err = run("simulate", "--vehicles", 4, "--sine", 6, "--json")
        self.assertEqual((code, err), (0, ""))
        sine = json.loads(out)["sine"]
        self.assertEqual(len(sine["acceleration"]), 3)
        # In a periodic motion, speed and acceleration differ by the same factor in all vehicles.
        for speed, acceleration in zip(sine["speed"], sine["acceleration"]):
            self.assertAlmostEqual(speed, acceleration, delta=0.02)

    def test_the_search_of_gains_ends_with_the_best(self):
        code, out, err = run("tune", "--vehicles", 3, "--hz", 10, "--loss", 10, "--seeds", 1, "--seconds", 12)
        self.assertEqual((code, err), (0, ""))
        costs = [float(line.rpartition(" ")[2]) for line in out.splitlines()]
        self.assertRegex(out, r"^start +q1 1\.\d+, .*\n(better +q1 .*\n)*best +q1 .*\n$")
        self.assertEqual(costs, sorted(costs, reverse=True))

    def test_a_record_that_cannot_be_written(self):
        code, _, err = run("simulate", "--vehicles", 2, "--record", "/nowhere/record.json")
        self.assertEqual(code, 5)
        self.assertRegex(err, "^cles-platoon: cannot write /nowhere/record.json: No such file or directory")

    def test_a_drive_is_told_even_if_its_record_cannot_be_written(self):
        where = ("run", "--multicast", free_group(), "--vehicles", 2, "--seconds", 3, "--record")
        self.assertEqual(run(*where, "/nowhere/record.json"),  # known before it starts
                         (5, "", "cles-platoon: cannot write /nowhere/record.json: No such file or directory\n"))
        code, out, err = run(*where, "/dev/full")
        self.assertEqual((code, err), (5, "cles-platoon: cannot write /dev/full: No space left on device\n"))
        self.assertRegex(out, r"(?m)^gap +\d+\.\d{3} m at least\nradar")
        self.assertRegex(out, r"(?m)^latency   p50 \d")

    def test_on_a_terminal_it_shows_a_table(self):
        controller, terminal = pty.openpty()
        watcher = start("run", "--multicast", free_group(), "--vehicles", 2, "--seconds", 2, stdout=terminal)
        os.close(terminal)
        shown = b""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and select.select([controller], [], [], PATIENCE)[0]:
            try:
                part = os.read(controller, 65536)
            except OSError:  # its end
                break
            shown += part
        os.close(controller)
        watcher.communicate(timeout=PATIENCE)
        self.assertEqual(watcher.returncode, 4)  # the leader has not braked yet
        self.assertRegex(shown.decode(), r"\x1b\[H\x1b\[J +\d+\.\d s +m/s +m/s2  distance   error\r\nv0 +2\d\.\d\d .* lead")
        self.assertRegex(shown.decode(), r"\nv1 +2\d\.\d\d .* 1\d\.\d\d .* follow")


if __name__ == "__main__":
    unittest.main()
