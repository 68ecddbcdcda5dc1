#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A platoon with security: it drives as without, all of it is sealed, and only members with the right to are heard."""

import json
import os
import re
import signal
import socket
import struct
import subprocess
import tempfile
import threading
import unittest

from processes import PATIENCE, PLATOON, DriveTest, ended, environment, free_group, read_until, run, start, wait_until
from support import CLES
from two_hosts import Hosts

SEALED = 0x80  # the first byte of a sealed datagram, or more


class Listener:
    """Records what is sent to a group on loopback."""

    def __init__(self, group):
        address, port = re.fullmatch(r"lo,(\S+):(\d+)", group).groups()
        self.heard, self.ends = [], False
        self.socket = socket.socket(type=socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind((address, int(port)))
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                               struct.pack("4s4s", socket.inet_aton(address), socket.inet_aton("127.0.0.1")))
        self.socket.settimeout(0.1)
        self.thread = threading.Thread(target=self._read, daemon=True)
        self.thread.start()

    def _read(self):
        while not self.ends:
            try:
                self.heard.append(self.socket.recv(2000))
            except TimeoutError:
                pass

    def close(self):
        """May be called twice."""
        self.ends = True
        self.thread.join(PATIENCE)
        self.socket.close()


class Secured(DriveTest):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = scratch.name
        self.group = free_group()

    def cles(self, *arguments):
        return subprocess.run([CLES, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE,
                              env={**environment(), "CLES_MULTICAST": self.group}, check=False)

    def good(self, *arguments):
        done = self.cles(*arguments)
        self.assertEqual(done.returncode, 0, (arguments, done.stderr))
        return done.stdout

    def fleet(self, *names, name="fleet", **rights):
        """The folder of a new fleet; `rights` are options of `cles fleet rights`, by the member's name."""
        folder = os.path.join(self.folder, name)
        self.good("fleet", "init", folder, "--with", ",".join(names))
        for member, options in rights.items():
            self.good("fleet", "rights", member, *options, "--keys", folder)
        for member in names if rights else ():
            self.good("keys", "join", f"{folder}/roster", "--keys", f"{folder}/{member}")
        return folder

    def listen(self):
        listener = Listener(self.group)
        self.addCleanup(listener.close)
        return listener

    def vehicle(self, *arguments):
        process = start("vehicle", "--multicast", self.group, *arguments)
        self.addCleanup(ended, process)
        return process

    def check_kept_its_distance(self, found, vehicles):
        self.assertTrue(found["steady"], found["events"])
        self.assertEqual(len(found["courses"]), vehicles)
        self.assertGreater(found["latency"]["count"], vehicles * 50)
        self.assertLess(found["latency"]["p50_us"], 100_000)
        self.assertEqual(found["lost"], 0)


class Drive(Secured):
    def test_vehicles_keep_their_distance_and_nobody_can_read(self):
        os.environ["TMPDIR"] = self.folder
        self.addCleanup(os.environ.pop, "TMPDIR", None)
        plain = self.listen()
        self.drive("--vehicles", 2, "--seconds", 1, group=self.group)
        plain.close()
        self.assertTrue(any(b":state" in datagram for datagram in plain.heard))
        sealed = self.listen()
        found = self.drive("--vehicles", 4, "--hz", 50, "--seconds", 7, "--secured", group=self.group)
        sealed.close()
        self.assertGreater(len(sealed.heard), 4 * 50)
        for datagram in sealed.heard:
            self.assertGreaterEqual(datagram[0], SEALED)
            self.assertNotIn(b"state", datagram)
        self.check_kept_its_distance(found, 4)
        self.assertGreater(found["verdict"]["error"][0], 0.01)  # it brakes, so that there is an error
        self.assertLess(max(found["verdict"]["error"]), 2)
        self.assertEqual(os.listdir(self.folder), [])  # the keys are gone

    def test_vehicles_join_and_leave(self):
        found = self.drive("--vehicles", 4, "--seconds", 8, "--join", "3@0.5", "--leave", "2@4", "--secured")
        self.assertIn("left", self.modes(found, "v2"))
        self.assertIsNone(self.speed(found, "v2"))
        self.assertIsNotNone(self.speed(found, "v3"))
        self.assertNotIn("gone", self.modes(found, "v3"))

    def test_with_faults(self):
        found = self.drive("--vehicles", 3, "--hz", 50, "--seconds", 4, "--loss", 10, "--leave", "1@1", "--secured")
        self.assertIn("left", self.modes(found, "v1"))
        self.assertGreater(found["missed"], 0)

    def test_a_vehicle_vanishes(self):
        found = self.drive("--vehicles", 3, "--seconds", 6, "--vanish", "1@2", "--secured")
        self.assertIn("killed", self.modes(found, "v1"))
        self.assertIn("radar", self.modes(found, "v2"))

    def test_the_keys_are_removed_when_it_is_interrupted(self):
        os.environ["TMPDIR"] = self.folder
        self.addCleanup(os.environ.pop, "TMPDIR", None)
        for number in (signal.SIGINT, signal.SIGTERM):
            process = start("run", "--multicast", self.group, "--vehicles", 2, "--secured")
            self.addCleanup(ended, process)
            wait_until(lambda: any(os.path.exists(f"{self.folder}/{each}/v1/roster") for each in os.listdir(self.folder)),
                       "the keys exist")
            (made,) = os.listdir(self.folder)
            self.assertEqual(os.stat(os.path.join(self.folder, made)).st_mode & 0o777, 0o700)
            process.send_signal(number)
            process.communicate(timeout=PATIENCE)
            self.assertEqual(process.returncode, 4)  # the manoeuvre did not end
            self.assertEqual(os.listdir(self.folder), [])

    def test_a_fleet_of_ones_own(self):
        folder = self.fleet("operator", "v0", "v1")
        found = self.drive("--vehicles", 2, "--hz", 50, "--seconds", 3, "--keys", folder)
        self.check_kept_its_distance(found, 2)

    def test_the_variable_names_a_member_and_not_a_fleet(self):
        folder = self.fleet("operator", "v0", "v1")
        variable = {**environment(), "CLES_KEYS": f"{folder}/operator"}
        for options, is_sealed in (([], False), (["--keys", folder], True), (["--secured"], True)):
            group = free_group()
            listener = Listener(group)
            self.addCleanup(listener.close)
            process = subprocess.run([PLATOON, "run", "--vehicles", "2", "--seconds", "1", "--json", "--multicast", group,
                                      *options], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                                     timeout=PATIENCE, check=False, env=variable)
            listener.close()
            self.assertEqual((process.returncode, process.stderr), (4, ""), options)  # nobody has braked
            self.assertTrue(listener.heard)
            self.assertEqual({datagram[0] >= SEALED for datagram in listener.heard}, {is_sealed}, options)

    def test_a_vehicle_takes_the_key_of_the_variable(self):
        folder = self.fleet("v0")
        done = subprocess.run([PLATOON, "vehicle", "--lead", "--seconds", "1", "--report", "--multicast", self.group],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE, check=False,
                              env={**environment(), "CLES_KEYS": f"{folder}/v0"})
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn('"vehicle":"v0"', done.stdout)


class Strangers(Secured):
    def test_they_are_not_heard(self):
        # Both pass for the leader: one has no key, the other that of another fleet.
        folder, others = self.fleet("operator", "v0", "v1", "v2"), self.fleet("v0", name="others")
        listener = self.listen()
        self.vehicle("--name", "v0", "--lead", "--x", 500)
        self.vehicle("--keys", f"{others}/v0", "--lead", "--x", 500)
        for first in (lambda byte: byte < SEALED, lambda byte: byte >= SEALED):
            wait_until(lambda here=first: sum(here(datagram[0]) for datagram in listener.heard) > 0, "both send")
        plain = self.vehicle("--name", "v8", "--join")  # hears only the other without a key
        found = self.drive("--vehicles", 3, "--hz", 50, "--seconds", 4, "--keys", folder, group=self.group)
        self.check_kept_its_distance(found, 3)
        self.assertLess(max(found["verdict"]["error"]), 0.5)
        self.assertIsNone(plain.poll())

    def test_a_platoon_cannot_be_joined_without_a_key(self):
        folder = self.fleet("v0")
        self.vehicle("--keys", f"{folder}/v0", "--lead")
        wait_until(lambda: "v0" in self.cles("ls", "--keys", f"{folder}/v0").stdout, "v0 is there")
        code, out, err = run("vehicle", "--name", "v1", "--multicast", self.group)
        self.assertEqual((code, out), (3, ""))
        self.assertIn("there is no platoon", err)

    def test_a_member_that_may_only_watch_does_not_lead(self):
        for offers, code in (("all", 0), ("none", 3)):
            self.group = free_group()
            folder = self.fleet("operator", "v0", "v1", name=offers, operator=["--offers", offers])
            listener = self.listen()
            self.vehicle("--keys", f"{folder}/operator", "--lead")  # as a thief of the key might
            wait_until(lambda heard=listener.heard: heard, "it sends")
            joined, out, err = run("vehicle", "--keys", f"{folder}/v1", "--multicast", self.group, "--seconds", 1)
            self.assertEqual((joined, out), (code, ""), err)

    def test_who_may_make_a_vehicle_leave(self):
        folder = self.fleet("operator", "v0", "v1", v1=["--may", "bind *:state", "--may", "push *:join"])
        leader = self.vehicle("--keys", f"{folder}/v0", "--lead")
        wait_until(lambda: "v0" in self.cles("ls", "--keys", f"{folder}/operator").stdout, "v0 is there")
        done = self.cles("push", "v0:leave", "--keys", f"{folder}/v1")
        self.assertEqual((done.returncode, done.stdout, done.stderr),
                         (5, "", "cles: denied: v1 may not send PUSH 'leave' to v0\n"))
        self.assertIsNone(leader.poll())
        self.good("push", "v0:leave", "--keys", f"{folder}/operator")
        self.assertEqual(leader.wait(PATIENCE), 0)

    def test_states_are_signed(self):
        folder = self.fleet("operator", "v0")
        self.vehicle("--keys", f"{folder}/v0", "--lead")
        wait_until(lambda: "v0" in self.cles("ls", "--keys", f"{folder}/operator").stdout, "v0 is there")
        offered = json.loads(self.good("pull", "v0:cles", "--keys", f"{folder}/operator", "-o", "json"))["tasks"]
        self.assertEqual([task["task"] for task in offered if task.get("signed")], ["localization", "state"])


class TwoHosts(Secured):
    def at(self, host, *arguments):
        process = subprocess.Popen([*self.hosts.inside(host), PLATOON, *map(str, arguments)], stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment())
        self.addCleanup(ended, process)
        return process

    def test_one_joins_from_another_host(self):
        self.hosts = Hosts()
        self.addCleanup(self.hosts.close)
        folder = self.fleet("operator", "v0", "v1", "v9")
        watcher = self.at(self.hosts.near, "run", "--multicast", "v0", "--keys", folder, "--vehicles", 2, "--seconds", 60)
        read_until(watcher, r"\d s  2 vehicles")
        joins = self.at(self.hosts.far, "vehicle", "--keys", f"{folder}/v9", "--multicast", "v1", "--seconds", 3, "--report")
        out, err = joins.communicate(timeout=PATIENCE)
        self.assertEqual(joins.returncode, 0, err)
        self.assertRegex(out, r'"vehicle":"v9".*"received":[1-9]\d')


class Usage(Secured):
    def test_what_is_wrong_is_said(self):
        folder = self.fleet("operator", "v0")
        for code, said, arguments in (
                (5, f"{folder} has no keys of v1,v2: name the folder of a fleet, which 'cles fleet init DIR --with "
                    "operator,v0,v1,v2' creates; to an existing one, 'cles keys new' and 'cles fleet add' add members",
                 ("run", "--vehicles", 3, "--keys", folder)),
                (5, f"the key in {folder}/v0 is that of 'v0', and this node is 'v1'",
                 ("vehicle", "--keys", f"{folder}/v0", "--name", "v1")),
                (5, "cannot open the folder /nowhere: No such file or directory", ("vehicle", "--keys", "/nowhere")),
                (2, "which vehicle is it? Give --name, or --keys with the key of a member of a fleet", ("vehicle",))):
            self.assertEqual(run(*arguments), (code, "", f"cles-platoon: {said}\n"))
        code, _, err = run("run", "--keys", folder, "--secured")
        self.assertEqual(code, 2)
        self.assertIn("--secured", err)


if __name__ == "__main__":
    unittest.main()
