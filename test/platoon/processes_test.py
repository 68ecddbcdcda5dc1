#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A platoon as its users run it: each vehicle a process, one of which is killed, joins or leaves."""

import json
import os
import pty
import re
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "cli"))
from two_hosts import Hosts  # noqa: E402

PLATOON = os.environ["PLATOON"]
PATIENCE = float(os.environ.get("CLES_TEST_PATIENCE", "60"))


def environment():
    return {name: value for name, value in os.environ.items() if not name.startswith("CLES_M")}


def free_group():
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"lo,239.255.25.37:{probe.getsockname()[1]}"


def start(*arguments, stdout=subprocess.PIPE, **more):
    return subprocess.Popen([PLATOON, *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=stdout,
                            stderr=subprocess.PIPE, text=True, env=environment(), **more)


def run(*arguments):
    """Exit code, stdout, stderr."""
    process = start(*arguments)
    try:
        out, err = process.communicate(timeout=PATIENCE)
    finally:
        ended(process)
    return process.returncode, out, err


def ended(process):
    """Sees to it that nothing is left of it."""
    process.kill()
    process.wait()
    for pipe in (process.stdout, process.stderr):
        if pipe:
            pipe.close()


def children_of(pid):
    with open(f"/proc/{pid}/task/{pid}/children", encoding="ascii") as children:
        return [int(child) for child in children.read().split()]


def is_running(pid):
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until(condition, what):
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError(f"waited in vain: {what}")


class Drive(unittest.TestCase):
    def drive(self, *arguments, code=0):
        """The object that it prints."""
        ended, out, err = run("run", "--multicast", free_group(), "--json", *arguments)
        self.assertEqual(ended, code, err + out[:2000])
        found = json.loads(out)
        self.assertFalse(found["verdict"]["collision"], found["events"])
        return found

    def modes(self, found, vehicle):
        return [event["mode"] for event in found["events"] if event["vehicle"] == vehicle]

    def speed(self, found, vehicle):
        """At the end; None: it is not on the lane."""
        return next(course for course in found["courses"] if course["vehicle"] == vehicle)["speed"][-1]

    def test_vehicles_hear_each_other_and_keep_their_distance(self):
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "record.json")
            found = self.drive("--vehicles", 4, "--hz", 50, "--seconds", 7, "--record", file)
            with open(file, encoding="utf-8") as record:
                self.assertEqual(json.load(record), found)
        self.assertTrue(found["steady"], found["events"])
        self.assertGreater(found["verdict"]["error"][0], 0.01)  # it brakes, so that there is something to see
        self.assertLess(max(found["verdict"]["error"]), 2)
        self.assertGreater(found["latency"]["count"], 4 * 50)
        self.assertGreater(found["latency"]["p50_us"], 0)
        self.assertLess(found["latency"]["p50_us"], 100_000)
        self.assertEqual(found["lost"], 0)

    def test_what_is_lost_on_purpose_is_lost(self):
        found = self.drive("--vehicles", 3, "--hz", 50, "--seconds", 3, "--loss", 20, "--delay", 20)
        self.assertAlmostEqual(found["lost"] / found["received"], 0.2, delta=0.1)

    # -- who is killed ---------------------------------------------------------------------------------------------------

    def test_the_leader_is_killed(self):
        found = self.drive("--vehicles", 4, "--seconds", 10, "--vanish", "0@0.5")
        self.assertFalse(found["steady"])
        self.assertIn("gone", self.modes(found, "v0"))
        self.assertIn("fallback", self.modes(found, "v1"))
        for vehicle in ("v1", "v2", "v3"):
            self.assertLess(self.speed(found, vehicle), 1, found["events"])

    def test_one_in_the_middle_is_killed(self):
        found = self.drive("--vehicles", 5, "--seconds", 5, "--vanish", "2@1")
        self.assertIn("fallback", self.modes(found, "v3"))
        self.assertIn("v2 ahead is silent", [e["why"] for e in found["events"]])
        for vehicle in ("v3", "v4"):  # which brake, while the leader does not yet
            self.assertLess(self.speed(found, vehicle), 18, found["events"])
        for vehicle in ("v0", "v1"):
            self.assertGreater(self.speed(found, vehicle), 24, found["events"])

    def test_the_last_is_killed(self):
        found = self.drive("--vehicles", 3, "--seconds", 4, "--vanish", "2@1")
        self.assertIn("gone", self.modes(found, "v2"))
        for vehicle in ("v0", "v1"):
            self.assertGreater(self.speed(found, vehicle), 24, found["events"])

    def test_the_watcher_is_killed_and_nothing_is_left(self):
        watcher = start("run", "--multicast", free_group(), "--vehicles", 3, "--seconds", 60)
        self.addCleanup(watcher.stderr.close)
        self.addCleanup(watcher.stdout.close)
        wait_until(lambda: len(children_of(watcher.pid)) == 3, "its vehicles are there")
        vehicles = children_of(watcher.pid)
        watcher.kill()
        watcher.wait()
        wait_until(lambda: not any(map(is_running, vehicles)), "its vehicles end")

    def test_interrupted_it_ends_well(self):
        watcher = start("run", "--multicast", free_group(), "--vehicles", 2, "--seconds", 60, start_new_session=True)
        self.addCleanup(ended, watcher)
        for _ in range(3):  # after which they have heard each other
            self.assertRegex(watcher.stdout.readline(), r"\d s  2 vehicles")
        vehicles = children_of(watcher.pid)
        os.killpg(watcher.pid, signal.SIGINT)  # as a terminal does
        out, err = watcher.communicate(timeout=PATIENCE)
        self.assertEqual((watcher.returncode, err), (0, ""))
        self.assertRegex(out, r"(?m)^spacing   \d")  # nobody has left before its time
        self.assertRegex(out, r"(?m)^latency   p50 \d")
        self.assertFalse(any(map(is_running, vehicles)))

    # -- who comes and goes ----------------------------------------------------------------------------------------------

    def test_one_joins_at_the_end(self):
        found = self.drive("--vehicles", 4, "--seconds", 10, "--join", "3@0.5")
        course = next(c for c in found["courses"] if c["vehicle"] == "v3")
        self.assertIsNone(course["error"][0])
        errors = [e for e in course["error"] if e is not None]
        self.assertGreater(max(errors), 15)
        self.assertLess(abs(errors[-1]), max(errors) - 4)  # it catches up, with time

    def test_one_leaves_and_the_gap_is_closed(self):
        found = self.drive("--vehicles", 4, "--seconds", 9, "--leave", "2@0.5")
        self.assertIn("left", self.modes(found, "v2"))
        self.assertIsNone(self.speed(found, "v2"))
        errors = next(c for c in found["courses"] if c["vehicle"] == "v3")["error"]
        gap = max(e for e in errors if e is not None)
        self.assertGreater(gap, 10)
        self.assertLess(abs(errors[-1]), gap - 5)

    # -- what is missing -------------------------------------------------------------------------------------------------

    def test_nobody_leads(self):
        group = free_group()
        code, out, err = run("vehicle", "--name", "v9", "--multicast", group)
        self.assertEqual((code, out), (3, ""))
        self.assertEqual(err, f"cles-platoon: there is no platoon: no vehicle was found in the group {group[3:]}\n")

    def test_the_one_ahead_is_not_there(self):
        code, out, err = run("vehicle", "--name", "v1", "--ahead", "v0", "--multicast", free_group(), "--seconds", 2)
        self.assertEqual((code, out), (0, ""))
        self.assertRegex(err, r"^ +1\.\d+ s  v1  fallback: v0 ahead was never heard\n$")

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
                          ["simulate", "--vanish", "3@"], ["vehicle"],
                          ["vehicle", "--name", "v1", "--lead", "--ahead", "v0"]):
            code, out, err = run(*arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertNotEqual(err, "", arguments)

    def test_a_record_that_cannot_be_written(self):
        code, _, err = run("simulate", "--vehicles", 2, "--record", "/nowhere/record.json")
        self.assertEqual(code, 5)
        self.assertRegex(err, "^cles-platoon: cannot write /nowhere/record.json: No such file or directory")

    def test_a_drive_is_told_even_if_its_record_cannot_be_written(self):
        where = ("run", "--multicast", free_group(), "--vehicles", 2, "--seconds", 3, "--record")
        self.assertEqual(run(*where, "/nowhere/record.json"),  # which is known before it begins
                         (5, "", "cles-platoon: cannot write /nowhere/record.json: No such file or directory\n"))
        code, out, err = run(*where, "/dev/full")
        self.assertEqual((code, err), (5, "cles-platoon: cannot write /dev/full: No space left on device\n"))
        self.assertRegex(out, r"(?m)^gap +\d+\.\d{3} m at least\nfallback")
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
        self.assertEqual(watcher.returncode, 0)
        self.assertRegex(shown.decode(), r"\x1b\[H\x1b\[J +\d+\.\d s +m/s +m/s2  distance   error\r\nv0 +2\d\.\d\d .* lead")
        self.assertRegex(shown.decode(), r"\nv1 +2\d\.\d\d .* 1\d\.\d\d .* follow")


class TwoHosts(unittest.TestCase):
    def at(self, host, *arguments):
        return subprocess.Popen([*self.hosts.inside(host), PLATOON, *map(str, arguments)], stdin=subprocess.DEVNULL,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment())

    def test_one_joins_from_another_host(self):
        self.hosts = Hosts()
        self.addCleanup(self.hosts.close)
        refused = self.at(self.hosts.near, "run", "--multicast", "v0")
        self.addCleanup(ended, refused)
        self.assertRegex(refused.communicate(timeout=PATIENCE)[1],
                         r"^cles-platoon: multicast on 'v0' can be reached from other hosts, .*\(--insecure\)\n$")
        watcher = self.at(self.hosts.near, "run", "--multicast", "v0", "--insecure", "--vehicles", 2, "--seconds", 60,
                          "--leave", "1@1")
        self.addCleanup(ended, watcher)
        self.assertRegex(watcher.stdout.readline(), r"\d s  2 vehicles")
        joins = self.at(self.hosts.far, "vehicle", "--join", "--name", "v9", "--multicast", "v1", "--insecure", "--seconds", 3,
                        "--report")
        self.addCleanup(ended, joins)
        out, err = joins.communicate(timeout=PATIENCE)
        self.assertEqual(joins.returncode, 0, err)
        self.assertGreater(json.loads(out)["received"], 10, err)
        self.assertIn("v1  left: in good order", "".join(watcher.stdout.readline() for _ in range(4)))


if __name__ == "__main__":
    unittest.main()
