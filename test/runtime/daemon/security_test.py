#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""clesd with security: its configuration, and daemons of one fleet."""

import errno
import json
import os
import pwd
import shutil
import subprocess
import unittest

from daemon import HOSTILE, clesd
from secured import Fleet, Node, cles
from support import PATIENCE, wait_until


class Configuration(unittest.TestCase):
    def setUp(self):
        self.fleet = Fleet("car1", "car2")
        self.addCleanup(self.fleet.__exit__)

    def refused(self, text, line, key, *words):
        file = self.fleet.write(text)
        for more in ((), ("--check",)):
            code, out, err = clesd("--config", file, *more)
            self.assertEqual((code, out), (2, ""), err)
            self.assertTrue(err.startswith(f"clesd: {file}:{line}: {key}: "), err)
            for each in words:
                self.assertIn(each, err)

    def test_a_directory_that_can_be_used(self):
        keys = self.fleet.keys("car1")
        file = self.fleet.write(f"security: {keys}\n")
        self.assertEqual(clesd("--config", file, "--check"), (0, f"{file}: can be used\n", ""))
        code, out, _ = clesd("--keys", keys, "--print-config", cwd="/")
        self.assertEqual(code, 0)
        for line in ('node: "car1"', 'listen: ["tls://0.0.0.0:25370", "udp://0.0.0.0:25370"]', f'security: "{keys}"'):
            self.assertIn(line, out)

    def test_a_missing_directory(self):
        self.refused("workers: 1\nsecurity: /nowhere/keys\n", 2, "security", "/nowhere/keys")

    def test_a_node_that_is_not_in_a_roster(self):
        self.fleet.run("keys", "new", "sat1", "-k", self.fleet.file("sat1"))
        self.refused(f"security: {self.fleet.file('sat1')}\n", 1, "security", "roster")

    def test_a_key_that_others_can_read(self):
        key = os.path.join(self.fleet.keys("car1"), "key")
        os.chmod(key, 0o644)
        self.refused(f"security:\n  keys: {self.fleet.keys('car1')}\n", 1, "security", key, "chmod")

    def test_another_name_than_that_of_the_key(self):
        self.refused(f"node: car2\nsecurity: {self.fleet.keys('car1')}\n", 1, "node", "'car2'", "'car1'")

    def test_an_unknown_user(self):
        self.refused(f"security:\n  keys: {self.fleet.keys('car1')}\n  local_users:\n    no_such_user: car2\n", 4,
                     "security.local_users.no_such_user", "there is no user 'no_such_user'")

    def test_a_user_who_is_two_members(self):
        users = f"    {pwd.getpwnam('nobody').pw_uid}: car1\n    nobody: car2\n"
        self.refused(f"security:\n  keys: {self.fleet.keys('car1')}\n  local_users:\n{users}", 5,
                     "security.local_users.nobody", "that user is car1 already")

    def test_plain_tcp(self):
        self.refused(f"security: {self.fleet.keys('car1')}\nlisten: tcp://127.0.0.1:0\n", 2, "listen[0]", "use 'tls'")

    def test_tls_without_security(self):
        self.refused("node: a\nlisten: tls://127.0.0.1:0\n", 2, "listen[0]", "requires 'security'")


class Daemons(unittest.TestCase):
    def test_a_fleet(self):
        with Fleet("car1", "car2", "sat1", "operator") as fleet, \
                Node(fleet, "car1") as car1, Node(fleet, "car2") as car2, Node(fleet, "sat1") as sat1:
            all_nodes = {"car1": car1, "car2": car2, "sat1": sat1}
            for name, node in all_nodes.items():
                wait_until(lambda node=node, name=name: node.peers() == set(all_nodes) - {name},
                           f"{name} has discovered the others")

            def ask(noun):
                return cles("pull", noun, "-k", fleet.keys("operator"), "--at", car1.url)

            self.assertEqual(ask("self:cles")[0], 0)
            self.assertIn("denied", ask("car2:cles")[2])  # car1 may not forward

            with self.subTest("rules change without a restart"):
                fleet.rule("car1", "deny operator may pull *:cles/**\n")
                wait_until(lambda: ask("self:cles")[0] == 5, "it is denied")
                fleet.rule("car1", "")
                wait_until(lambda: ask("self:cles")[0] == 0, "it is allowed")

            with self.subTest("a removed node"):
                fleet.run("fleet", "remove", "sat1", "-k", fleet.authority)
                fleet.run("keys", "join", os.path.join(fleet.authority, "roster"), "-k", fleet.keys("car1"))
                for name in ("car1", "car2"):
                    wait_until(lambda name=name: "sat1" not in all_nodes[name].peers(), f"{name} has dropped it")
                self.assertIn("refuses this node", sat1.ask("PULL car1:cles"))
                self.assertIn("refuses this node", sat1.ask("PULL car1:cles"))
                words = "the other end refused the link: the key of this node is not in roster 3 (127.0.0.1, key "
                said = [line for line in sat1.messages() if line.startswith(words)]
                self.assertEqual(len(set(said)), len(said), sat1.messages())  # one for each node that refuses it
                self.assertIn(len(said), (1, 2), sat1.messages())

            with self.subTest("a node that gets the roster of its removal by hand"):
                fleet.run("keys", "join", os.path.join(fleet.authority, "roster"), "-k", fleet.keys("car2"))
                fleet.run("fleet", "remove", "car2", "-k", fleet.authority)
                shutil.copy(os.path.join(fleet.authority, "roster"), os.path.join(fleet.keys("car2"), "new"))
                os.rename(os.path.join(fleet.keys("car2"), "new"), os.path.join(fleet.keys("car2"), "roster"))
                words = "car2 was removed from the fleet by version 4 of the roster"
                wait_until(lambda: words in car2.messages(), "it says so")
                self.assertEqual(car2.messages().count(words), 1)


@unittest.skipIf(os.geteuid() != 0, "needs another user")
class LocalUsers(unittest.TestCase):
    def ask_as(self, user, node, line):
        """What that user gets at the Unix socket."""
        script = ("import socket, sys\n"
                  "link = socket.socket(socket.AF_UNIX)\nlink.settimeout(20)\n"
                  "link.connect(sys.argv[1])\nlink.sendall(sys.argv[2].encode() + b'\\n')\n"
                  "print(link.makefile('r').readline(), end='')\n")
        done = subprocess.run(["python3", "-c", script, node.socket, line], user=user.pw_uid, group=user.pw_gid,
                              extra_groups=[], capture_output=True, text=True, timeout=PATIENCE, check=False, cwd="/")
        return done.stdout

    def test_users_count_as_members(self):
        nobody, daemon = pwd.getpwnam("nobody"), pwd.getpwnam("daemon")
        with Fleet("car1", "operator") as fleet:
            os.chmod(fleet.path, 0o755)
            fleet.rule("car1", "deny operator may pull *:cles/peers\n")
            with Node(fleet, "car1", "  local_users: {nobody: operator}\n", umask=0o022) as car1:
                self.assertIn('"node":"car1"', car1.ask("PULL self:cles"))
                self.assertIn('"node":"car1"', self.ask_as(nobody, car1, "PULL self:cles"))
                self.assertIn("denied", self.ask_as(nobody, car1, "PULL self:cles/peers"))
                self.assertNotIn('"node"', self.ask_as(daemon, car1, "PULL self:cles"))


def with_plugin(fleet, isolation):
    """The lines of a configuration for the plugin that says who asks."""
    os.mkdir(fleet.file("plugins"), 0o755)
    shutil.copy(HOSTILE, fleet.file("plugins"))
    return f"plugin_path: {fleet.file('plugins')}\nplugins:\n  - path: hostile.so\n    isolation: {isolation}\n"


class Forwarding(unittest.TestCase):
    def test_a_node_without_the_right_forwards_by_no_target(self):
        with Fleet("car1", "hub", "sat1") as fleet:
            fleet.rule("car1", "deny sat1 may pull *:caller\n")
            with Node(fleet, "car1", with_plugin(fleet, "none")), Node(fleet, "hub") as hub:
                wait_until(lambda: hub.peers() == {"car1"}, "hub has discovered car1")
                for target in ("car1", "any", "all"):
                    _, out, err = cles("pull", f"{target}:caller", "-k", fleet.keys("sat1"), "--at", hub.url)
                    self.assertNotIn("transport", out, target)
                    self.assertIn("hub may not forward requests of sat1 to ", out + err)

    def test_plugins_know_the_requester_and_the_forwarder(self):
        for isolation in ("none", "process"):
            with self.subTest(isolation), Fleet("car1", "hub", "sat1") as fleet:
                fleet.let_forward("hub")
                fleet.spread("car1", "hub")
                with Node(fleet, "car1", with_plugin(fleet, isolation)) as car1, Node(fleet, "hub") as hub:
                    wait_until(lambda: hub.peers() == {"car1"}, "hub has discovered car1")
                    for target in ("car1", "any"):
                        code, out, err = cles("pull", f"{target}:caller", "-k", fleet.keys("sat1"), "--at", hub.url,
                                              "-o", "json")
                        self.assertEqual(code, 0, err)
                        caller = json.loads(out)
                        self.assertEqual((caller["name"], caller["requester"], caller["forwarded_by"]),
                                         ("hub", "sat1", "hub"))
                    own = json.loads(car1.ask("PULL self:caller"))
                    self.assertEqual((own["transport"], own["requester"], own["forwarded_by"]), ("unix", "car1", ""))


class Isolation(unittest.TestCase):
    def test_an_isolated_plugin_sees_the_requester_and_not_the_key(self):
        with Fleet("car1", "car2") as fleet:
            with Node(fleet, "car1", with_plugin(fleet, "process")) as node:
                code, out, err = cles("pull", "car1:caller", "-k", fleet.keys("car2"), "--at", node.url, "-o", "json")
                self.assertEqual(code, 0, err)
                caller = json.loads(out)
                self.assertEqual((caller["transport"], caller["name"], caller["requester"]), ("tls", "car2", "car2"))
                confined = next(each for each in node.messages() if "confined to" in each)
                if "no Landlock" not in confined:
                    key = os.path.join(fleet.keys("car1"), "key").replace("/", "%2F")
                    self.assertEqual(json.loads(node.ask(f"PULL self:reads/{key}"))["value"], errno.EACCES)


if __name__ == "__main__":
    unittest.main()
