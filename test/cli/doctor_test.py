#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles doctor`: on separate hosts, each with a different fault."""

import json
import os
import subprocess
import sys
import unittest

from doctor_support import CLESD, GHOST, STRANGER, DoctorTest
from support import CLES, PATIENCE, read_line, wait_until


class Doctor(DoctorTest):
    def test_a_host_without_nodes_is_well(self):
        code, found = self.examine()
        self.assertEqual(code, 0, found)
        self.assertEqual(list(found), ["config", "interfaces", "multicast", "ports", "nodes", "clock", "limits"])
        self.assertEqual([each["text"] for each in found["ports"]],
                         ["tcp://127.0.0.1:25370 is free", "udp://127.0.0.1:25370 is free"])
        self.assertEqual(found["nodes"][0]["text"], "no nodes found")
        self.assertIn("v0 10.77.0.1", found["interfaces"][0]["text"])
        self.assertIn("datagrams to 239.255.25.37:25370 on lo are received", found["multicast"][0]["text"])

    def test_as_text(self):
        self.clesd("echo 'clesd: x.yaml:3: workers: wrong' >&2; exit 2")
        code, out = self.run_doctor("-o", "table")
        self.assertEqual(code, 1)
        first, second, third = out.splitlines()[:3]
        self.assertEqual(first, "failure  config      clesd: x.yaml:3: workers: wrong")
        self.assertRegex(second, r"^ {21}-> correct it")
        self.assertRegex(third, r"^ok       interfaces  ")

    def test_the_configuration(self):
        _, found = self.examine()
        self.assertEqual(found["config"], [{"check": "config", "verdict": "ok",
                                            "text": "clesd: without a file: can be used"}])
        self.clesd("kill -9 $$")
        self.failure(self.examine()[1], "config", "did not end by itself")
        self.clesd("exit 1")
        self.failure(self.examine()[1], "config", "rejects its configuration")

    def test_plugins_that_are_not_required(self):
        self.clesd("echo 'clesd: a.yaml:3: plugins[0].path: a.so: there is no such file (it is not required)' >&2; "
                   "echo 'clesd: a.yaml:5: plugins[1].path: b.so: it is no plugin (it is not required)' >&2; "
                   "echo 'a.yaml: can be used'")
        code, found = self.examine()
        self.assertEqual(code, 0, found)
        self.assertEqual([(each["verdict"], each["text"]) for each in found["config"]], [
            ("warning", "clesd: a.yaml:3: plugins[0].path: a.so: there is no such file (it is not required)"),
            ("warning", "clesd: a.yaml:5: plugins[1].path: b.so: it is no plugin (it is not required)"),
            ("ok", "clesd: a.yaml: can be used")])

    def test_a_check_that_takes_as_long_as_a_plugin_may(self):
        self.clesd("sleep 11; echo 'without a file: can be used'")
        _, found = self.examine()
        self.assertEqual([each["verdict"] for each in found["config"]], ["ok"])

    @unittest.skipUnless(CLESD, "clesd was not built")
    def test_what_clesd_itself_says_of_its_configuration(self):
        self.clesd(f'exec {CLESD} "$@"')
        config = os.path.join(self.folder.name, "clesd.yaml")
        with open(config, "w", encoding="utf-8") as file:
            file.write("node: sat1\nplugins: [libcles-system.so]\n")
        code, found = self.examine(CLES_CONFIG=config)
        self.assertEqual(code, 0, found)
        self.assertEqual(found["config"][0]["text"], f"clesd: {config}: can be used")
        with open(config, "a", encoding="utf-8") as file:
            file.write("workers: none\n")
        self.failure(self.examine(CLES_CONFIG=config)[1], "config", rf"clesd: {config}:3: workers: ")
        with open(config, "w", encoding="utf-8") as file:
            file.write(f"plugins:\n  - path: ./mine.so\n    sha256: {'0' * 64}\n")
        with open(os.path.join(self.folder.name, "mine.so"), "w", encoding="utf-8") as file:
            file.write("anything")
        os.chmod(file.name, 0o644)
        self.failure(self.examine(CLES_CONFIG=config)[1], "config", rf"clesd: {config}:3: plugins\[0\]\.sha256: .*SHA-256")
        self.failure(self.examine(CLES_CONFIG=config + "x")[1], "config", rf"{config}x")

    @unittest.skipUnless(CLESD, "clesd was not built")
    def test_clesd_at_the_usual_port(self):
        config = os.path.join(self.folder.name, "clesd.yaml")
        with open(config, "w", encoding="utf-8") as file:
            file.write("node: sat1\nplugins: [libcles-system.so]\n")
        daemon = self.start(CLESD, "--config", config, wait_for="sat1 listening on tcp://127.0.0.1:25370")
        self.assertIn("sat1 listening on udp://127.0.0.1:25370", read_line(daemon))
        code, found = self.examine()
        self.assertEqual(code, 0, found)
        by_tcp, by_udp = found["ports"]
        self.assertRegex(by_tcp["text"], r"^tcp://127.0.0.1:25370: the node sat1 listens here, version \d")
        # Its whole description does not fit into a datagram.
        self.assertRegex(by_udp["text"], r"^udp://127.0.0.1:25370: the node sat1 listens here, version \d")
        self.assertEqual(found["nodes"][0]["text"], "1 node found")
        self.assertFalse([each for each in found["clock"] if "sat1" in each["text"]])  # its clock is this host's

    def test_an_interface_that_is_not_there(self):
        code, found = self.examine(CLES_MULTICAST="nowhere0")
        self.assertEqual(code, 1)
        self.failure(found, "interfaces", "for nowhere0, which does not exist")
        self.failure(found, "multicast", "cannot join the group 239.255.25.37 on nowhere0")
        self.assertIn("ports", found)  # the other checks still run

    def test_an_interface_that_is_down(self):
        self.hosts.ip(self.hosts.near, "link", "set", "v0", "down")
        _, found = self.examine("-m", "v0")
        self.failure(found, "interfaces", "for v0, which is down")
        self.failure(found, "multicast", "v0")

    def test_what_two_machines_take(self):
        takes = ("to reach other hosts: CLES_MULTICAST=v0 (on each its own interface), nodes with --listen "
                 "tcp://10.77.0.1 --insecure, and UDP port 25370 open")
        on_loopback = self.examine()[1]["interfaces"][1]
        self.assertEqual(on_loopback["text"], "multicast uses lo: only nodes on this host find each other")
        self.assertEqual(on_loopback["advice"], takes)
        self.assertEqual(self.examine("-m", "v0")[1]["interfaces"][1]["advice"], takes)

    def test_another_interface(self):
        code, found = self.examine("-m", "v0")
        self.assertEqual(code, 0, found)
        self.assertEqual(found["interfaces"][1]["text"], "multicast uses v0")
        self.assertIn("25370 on v0 are received", found["multicast"][0]["text"])

    def test_no_multicast_wanted(self):
        code, found = self.examine("-m", "off")
        self.assertEqual(code, 0, found)
        self.assertIn("is off", found["multicast"][0]["text"])

    def test_a_node_at_the_usual_port(self):
        self.serve("car1", "--listen", "tcp://127.0.0.1", "--listen", "udp://127.0.0.1")
        code, found = self.examine()
        self.assertEqual(code, 0, found)
        for each, way in zip(found["ports"], ("tcp", "udp")):
            self.assertRegex(each["text"], rf"^{way}://127.0.0.1:25370: the node car1 listens here, version \d")
        self.assertEqual(found["nodes"][0]["text"], "1 node found")

    def test_a_stranger_at_the_usual_port(self):
        stranger = self.start(sys.executable, "-c", STRANGER, "tcp", wait_for="up")
        failure = self.failure(self.examine()[1], "ports", r"tcp://127\.0\.0\.1:25370: .* which is not a node")
        self.assertRegex(failure["text"], rf"python\S* \(process {stranger.pid}\)")

    def test_a_stranger_at_the_port_of_the_group(self):
        self.start(sys.executable, "-c", STRANGER, "udp", wait_for="up")
        _, found = self.examine()
        self.failure(found, "multicast", "cannot listen at udp port 25370: Address already in use")
        self.failure(found, "ports", "udp://127.0.0.1:25370")

    def test_two_nodes_of_one_name(self):
        for _ in range(2):
            self.serve("car1", "--listen", "tcp://127.0.0.1:0", "--allow-clash")
        found = {}

        def clash():
            found.update(self.examine()[1])
            return any("two nodes have the name car1" in each["text"] for each in found["nodes"])

        wait_until(clash, "the clash is told")
        self.failure(found, "nodes", "two nodes have the name car1")

    def test_a_node_that_does_not_answer(self):
        self.start(sys.executable, "-c", GHOST, "silent", "0", wait_for="up")
        _, found = self.examine()
        self.failure(found, "nodes", "ghost announces itself, but does not reply at tcp://127.0.0.1:")

    def test_another_clock(self):
        for offset, says in (("3600", "ahead of"), ("-3600", "behind")):
            ghost = self.start(sys.executable, "-c", GHOST, "answers", offset, wait_for="up")
            code, found = self.examine()
            self.assertEqual(code, 0, found)
            told = [each for each in found["clock"] if "ghost" in each["text"]]
            self.assertEqual([each["verdict"] for each in told], ["warning"])
            self.assertRegex(told[0]["text"], rf"^the clock of ghost is 3(600|599)\.\d+ s {says} that of this host$")
            ghost.kill()
            ghost.wait()
        self.start(sys.executable, "-c", GHOST, "answers", "0", wait_for="up")
        self.assertFalse([e for e in self.examine()[1]["clock"] if "ghost" in e["text"]])

    def test_a_named_place(self):
        self.serve("car1", "--listen", "tcp://127.0.0.1:25999")
        code, found = self.examine("--at", "tcp://127.0.0.1:25999")
        self.assertEqual(code, 0, found)
        self.assertIn("the node car1 listens here", found["ports"][0]["text"])
        _, found = self.examine("--at", "tcp://127.0.0.1:25998")
        self.failure(found, "ports", "25998 does not reply")

    def test_few_files(self):
        done = subprocess.run([*self.hosts.inside(self.hosts.near), "sh", "-c",
                               f"ulimit -n 200; exec {CLES} doctor -o json"], capture_output=True, text=True,
                              env=self.environment(), timeout=PATIENCE, check=False)
        limits = [each for each in json.loads(done.stdout)["findings"] if each["check"] == "limits"]
        self.assertEqual(limits[0]["verdict"], "warning")
        self.assertIn("200 files", limits[0]["text"])


if __name__ == "__main__":
    unittest.main()
