#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles doctor` on hosts that are well, and on hosts with one fault each: whether its verdict is the right one."""

import os
import subprocess
import sys
import unittest

from doctor_support import CLESD, GHOST, STRANGER, DoctorTest
from support import CLES, HAS_SECURITY, PATIENCE, wait_until

# A node on another host that does not receive what others send to the group.
DEAF = GHOST.replace("127.0.0.1", "10.77.0.2")


class Setups(DoctorTest):
    """Each test says what is wrong, and which verdict names it."""

    def start_far(self, *command, wait_for="listening", **variables):
        return self.start(*command, host=self.hosts.far, wait_for=wait_for, **{"CLES_MULTICAST": "v1", **variables})

    def serve_far(self, name, *arguments, **variables):
        return self.start_far(CLES, "serve", "--name", name, *arguments, **variables)

    def told(self, check, verdict, says, *arguments, advice="", **variables):
        """All findings. One of this check and verdict contains the text."""
        _, found = self.examine(*arguments, **variables)
        matching = [each for each in found[check] if each["verdict"] == verdict and says in each["text"]]
        self.assertEqual(len(matching), 1, found)
        self.assertIn(advice, matching[0].get("advice", ""))
        return found

    def well(self, *arguments, **variables):
        """All findings, none of which is a failure, and none a warning that is about nodes."""
        code, found = self.examine(*arguments, **variables)
        self.assertEqual(code, 0, found)
        warned = [e for check, each in found.items() if check not in ("clock", "limits") for e in each if e["verdict"] != "ok"]
        self.assertEqual([e for e in warned if "may lock only" not in e["text"]], [])
        return found


class Plain(Setups):
    """Without security."""

    # -- hosts that are well -----------------------------------------------------------------------------------------

    @unittest.skipUnless(CLESD, "clesd was not built")
    def test_the_hosts_of_two_machines(self):
        self.clesd(f'exec {CLESD} "$@"')  # which does not start by itself where CLES_MULTICAST leads to other hosts
        self.start(CLES, "serve", "--name", "car1", "--listen", "tcp://0.0.0.0", "--insecure", wait_for="listening",
                   CLES_MULTICAST="v0")
        for host, interface in ((self.hosts.near, "v0"), (self.hosts.far, "v1")):
            found = self.well(host=host, CLES_MULTICAST=interface)
            self.assertEqual(found["nodes"][0]["text"], "1 node found")
            self.assertIn(f"with CLES_MULTICAST={interface} in its environment, it does not start",
                          found["config"][0]["advice"])
        self.serve_far("car2", "--listen", "tcp://127.0.0.1", CLES_MULTICAST="lo")
        self.assertEqual(self.well(host=self.hosts.far, CLES_MULTICAST="lo,v1")["nodes"][0]["text"], "2 nodes found")

    def test_a_node_that_another_host_asks_for_what_it_knows(self):
        self.serve_far("car1", "--listen", "unix://@car1", "--listen", "tcp://0.0.0.0", "--insecure")
        self.well("--at", "tcp://10.77.0.2", CLES_MULTICAST="v0")

    # -- the host ----------------------------------------------------------------------------------------------------

    def test_an_interface_that_does_not_exist(self):
        self.told("interfaces", "failure", "for nowhere0, which does not exist", CLES_MULTICAST="nowhere0")

    def test_an_interface_that_is_down(self):
        self.hosts.ip(self.hosts.near, "link", "set", "v0", "down")
        self.told("interfaces", "failure", "for v0, which is down", CLES_MULTICAST="v0")

    def test_an_interface_without_an_address(self):
        self.hosts.ip(self.hosts.near, "address", "flush", "dev", "v0")
        self.told("interfaces", "failure", "for v0, which has no IPv4 address", CLES_MULTICAST="v0")

    def test_no_loopback(self):
        self.hosts.ip(self.hosts.near, "link", "set", "lo", "down")
        self.told("interfaces", "failure", "for lo, which is down")

    def test_the_port_of_the_group_is_taken(self):
        self.start(sys.executable, "-c", STRANGER, "udp", wait_for="up")
        self.told("multicast", "failure", "cannot listen at udp port 25370")

    def test_the_port_of_nodes_is_taken(self):
        self.start(sys.executable, "-c", STRANGER, "tcp", wait_for="up")
        self.told("ports", "failure", "which is not a node", advice="stop it")

    def test_few_files(self):
        self.told("limits", "warning", "200 files", limit="ulimit -n 200")

    def test_a_configuration_with_a_mistake(self):
        self.clesd("echo 'clesd: x.yaml:3: workers: wrong' >&2; exit 2")
        for group in ("lo", "v0"):
            self.told("config", "failure", "x.yaml:3: workers: wrong", CLES_MULTICAST=group)

    # -- other nodes -------------------------------------------------------------------------------------------------

    def test_nobody_at_the_address(self):
        self.told("ports", "failure", "25998 does not reply", "--at", "tcp://127.0.0.1:25998")

    def test_two_nodes_of_one_name(self):
        for _ in range(2):
            self.serve("car1", "--listen", "tcp://127.0.0.1:0", "--allow-clash")
        wait_until(lambda: any("two nodes have the name car1" in each["text"] for each in self.examine()[1]["nodes"]),
                   "the clash is told")
        self.told("nodes", "failure", "two nodes have the name car1")

    def test_a_node_that_does_not_reply(self):
        self.start(sys.executable, "-c", GHOST, "silent", "0", wait_for="up")
        self.told("nodes", "failure", "ghost announces itself, but does not reply")

    def test_a_node_whose_port_is_blocked(self):
        self.serve_far("car1", "--listen", "tcp://0.0.0.0:25999", "--insecure")
        self.hosts.ip(self.hosts.near, "rule", "add", "pref", "1", "ipproto", "tcp", "dport", "25999", "unreachable")
        self.told("nodes", "failure", "car1 announces itself, but does not reply at tcp://10.77.0.2:25999",
                  advice="firewall", CLES_MULTICAST="v0")

    def test_a_node_that_receives_no_multicast(self):
        self.start_far(sys.executable, "-c", DEAF.replace("sleep(0.05)", "sleep(1)"), "answers", "0", wait_for="up")
        says = "ghost is received, but does not receive what this host sends to the group"
        told = []  # it may announce itself by chance when it is asked

        def is_told():
            told[:] = [e for e in self.examine(CLES_MULTICAST="v0")[1]["nodes"] if e["text"] == says]
            return told

        wait_until(is_told, "it is told")
        self.assertEqual(told[0]["verdict"], "failure")
        self.assertIn("open incoming UDP port 25370", told[0]["advice"])

    def test_a_node_that_only_its_own_host_can_reach(self):
        self.serve_far("car1", "--listen", "tcp://127.0.0.1", "--insecure")
        self.told("nodes", "warning", "car1 does not listen at an address that is reachable from this host",
                  advice="--listen tcp://0.0.0.0 --insecure", CLES_MULTICAST="v0")

    def test_a_node_in_another_group(self):
        self.serve_far("car1", "--listen", "tcp://0.0.0.0", "--insecure", "-m", "v1,239.255.25.37:25371")
        self.told("nodes", "warning", "no nodes found on v0", advice="UDP port 25370 open", CLES_MULTICAST="v0")

    def test_a_node_that_does_not_announce_itself(self):
        self.serve("car1", "--multicast", "off")
        self.told("nodes", "warning", "the node at tcp://127.0.0.1:25370 does not announce itself there",
                  advice="--multicast")

    def test_a_node_of_another_pool(self):
        self.serve("car1", "--pool", "north")
        self.told("nodes", "failure", "no nodes found on lo, but announcements of nodes of other pools",
                  advice="CLES_POOL")

    def test_a_node_of_another_version_of_the_protocol(self):
        self.start(sys.executable, "-c", GHOST.replace('"protocol": 1', '"protocol": 2'), "answers", "0", wait_for="up")
        self.told("nodes", "failure", "ghost uses version 2 of the protocol, not 1", advice="same version")

    def test_something_that_is_no_node(self):
        self.start(sys.executable, "-c", GHOST.replace('"protocol": 1, ', ''), "answers", "0", wait_for="up")
        self.told("nodes", "failure", "the reply of ghost does not describe a node")

    def test_a_clock_that_differs(self):
        self.start(sys.executable, "-c", GHOST, "answers", "3600", wait_for="up")
        self.told("clock", "warning", "ahead of that of this host")


@unittest.skipUnless(HAS_SECURITY, "built without security")
class Secured(Setups):
    """A fleet of car1, car2 and operator; `other` is another one."""

    def setUp(self):
        super().setUp()
        self.cles("fleet", "init", "fleet", "--with", "car1,car2,operator")

    def cles(self, *arguments):
        subprocess.run([CLES, *arguments], check=True, cwd=self.folder.name, capture_output=True, timeout=PATIENCE,
                       env=self.environment())

    def keys(self, name, fleet="fleet"):
        return os.path.join(self.folder.name, fleet, name)

    def serve_secured(self, name="car1", **variables):
        return self.start(CLES, "serve", "--keys", self.keys(name), "--rate", "0", wait_for="listening",
                          **{"CLES_MULTICAST": "", **variables})

    def told_to(self, keys, check, verdict, says, *arguments, **more):
        return self.told(check, verdict, says, "--keys", keys, *arguments, **{"CLES_MULTICAST": "", **more})

    # -- hosts that are well -----------------------------------------------------------------------------------------

    def test_two_hosts_with_keys(self):
        self.serve_secured()
        for host in (self.hosts.near, self.hosts.far):
            found = self.well("--keys", self.keys("operator"), host=host, CLES_MULTICAST="")
            self.assertEqual(found["nodes"][0]["text"], "1 node found", found)
            for each in found["interfaces"]:  # what it advises can be done with keys
                self.assertNotIn("tcp://", each.get("advice", ""))
                self.assertNotIn("--insecure", each.get("advice", ""))

    def test_the_key_of_a_node_that_runs(self):
        self.serve_secured()
        found = self.well("--keys", self.keys("car1"), CLES_MULTICAST="")
        self.assertEqual(found["nodes"][0]["text"], "1 node found")

    # -- keys --------------------------------------------------------------------------------------------------------

    def test_the_key_of_another_fleet(self):
        self.cles("fleet", "init", "other", "--with", "car1,operator")
        self.serve_secured()
        found = self.told_to(self.keys("operator", "other"), "nodes", "failure", "but datagrams that this key cannot open",
                             advice="another fleet")
        self.assertEqual([e["verdict"] for e in found["ports"]], ["failure"])
        self.assertIn("refuses this key", found["ports"][0]["text"])
        self.told_to(self.keys("operator", "other"), "nodes", "failure", "but datagrams that this key cannot open",
                     host=self.hosts.far)

    def test_no_key_where_nodes_have_security(self):
        self.serve_secured(CLES_MULTICAST="lo")
        self.told("nodes", "failure", "but datagrams that cannot be read", advice="--keys DIR")

    def test_a_key_where_nodes_have_no_security(self):
        self.start(CLES, "serve", "--name", "car1", wait_for="listening", CLES_MULTICAST="lo")
        self.told_to(self.keys("operator"), "nodes", "failure", "but datagrams that are not sealed", advice="without --keys")

    def test_a_right_that_is_missing(self):
        self.cles("fleet", "rights", "operator", "--may", "pull *:localization", "-k", "fleet")
        for name in ("car1", "operator"):
            self.cles("keys", "join", "fleet/roster", "-k", f"fleet/{name}")
        self.serve_secured()
        for host in (self.hosts.near, self.hosts.far):
            self.told_to(self.keys("operator"), "keys", "warning",
                         "operator may not BIND and PULL 'cles' of any other member, so it cannot find them",
                         advice="cles fleet rights operator --may", host=host)

    def test_rights_that_are_minimal_on_purpose(self):
        for rights in ("none", "pull,bind *:localization"):
            self.cles("fleet", "rights", "operator", "--may", rights, "-k", "fleet")
            for name in ("car1", "operator"):
                self.cles("keys", "join", "fleet/roster", "-k", f"fleet/{name}")
            node = self.serve_secured()
            code, found = self.examine("--keys", self.keys("operator"), CLES_MULTICAST="")
            self.assertEqual(code, 0, found)
            node.kill()
            node.wait()

    def test_a_right_to_ask_that_is_missing(self):
        self.cles("fleet", "rights", "operator", "--may", "bind *:cles", "-k", "fleet")
        for name in ("car1", "operator"):
            self.cles("keys", "join", "fleet/roster", "-k", f"fleet/{name}")
        self.serve_secured()
        found = self.told_to(self.keys("operator"), "nodes", "warning", "car1 denies what nodes ask each other",
                             advice="cles fleet rights")
        self.assertNotIn("firewall", str(found["nodes"]))

    def test_a_key_that_is_not_in_the_roster(self):
        self.cles("keys", "new", "sat1", "-k", "sat1")
        self.told_to(os.path.join(self.folder.name, "sat1"), "keys", "failure", "sat1 is not a member of a fleet")

    def test_a_key_that_others_can_read(self):
        os.chmod(os.path.join(self.keys("operator"), "key"), 0o644)
        self.told_to(self.keys("operator"), "keys", "failure", "chmod")

    def test_rules_with_a_mistake(self):
        with open(os.path.join(self.keys("operator"), "rules"), "w", encoding="utf-8") as file:
            file.write("allow everything\n")
        os.chmod(file.name, 0o600)
        self.told_to(self.keys("operator"), "keys", "failure", "every request is denied")


if __name__ == "__main__":
    unittest.main()
