#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles` with the key of a member: --keys and CLES_KEYS in commands that talk to nodes, and in `cles serve`."""

import json
import os
import pwd
import re
import shutil
import signal
import socket
import subprocess
import unittest

from support import CLES, PATIENCE, environment, finish, free_port, read_line, start, wait_until
from trust_support import Done, Trust

ECHO = '{"parameters":["7"]}\n'


class Secured(Trust):
    """A fleet of car1, car2 and operator, of which car1 runs."""

    def setUp(self):
        super().setUp()
        self.logs = {}
        self.group = f"lo,239.255.0.7:{free_port()}"
        self.good("fleet", "init", "fleet", "--with", "car1,car2,operator")
        self.car1 = self.serve("car1", "-l", f"unix://{self.path('car1.sock')}")

    def run_in(self, *arguments, stdin="", env=None):
        done = subprocess.run([CLES, *arguments], input=stdin, capture_output=True, text=True, cwd=self.scratch,
                              env=env or environment(CLES_MULTICAST=self.group), timeout=PATIENCE, check=False)
        return Done(done.returncode, done.stdout, done.stderr)

    def serve(self, name, *more):
        """Starts it at a free port; returns the URL."""
        process = start("serve", "-k", f"fleet/{name}", "-l", "tls://127.0.0.1:0", "--rate", "0", *more,
                        cwd=self.scratch, env=environment(CLES_MULTICAST=self.group))
        self.addCleanup(self.end, process)
        self.logs[name] = process
        found = re.fullmatch(rf"{name} listening on (tls://127\.0\.0\.1:\d+)\n", read_line(process))
        self.assertTrue(found)
        return found[1]

    def end(self, process):
        process.send_signal(signal.SIGTERM)
        self.assertEqual(finish(process)[0], 0)

    def logged(self, name, text):
        """The line of the node's log that contains the text."""
        process = self.logs[name]
        while line := read_line(process, process.stderr):
            if text in line:
                return line
        raise AssertionError(f"it ended, and did not log '{text}'")

    def names(self, *arguments):
        return [node["node"] for node in json.loads(self.good("ls", *arguments, "-o", "json").out)["peers"]]

    # -- reaching nodes --------------------------------------------------------------------------------------------

    def test_a_member_finds_nodes_by_their_names(self):
        for _ in range(3):  # each is another process with the same key
            self.assertEqual(self.good("pull", "car1:echo/7", "-k", "fleet/operator").out, ECHO)
        self.assertEqual(self.names("-k", "fleet/operator"), ["car1"])

    def test_the_variable(self):
        env = environment(CLES_MULTICAST=self.group, CLES_KEYS="fleet/operator")
        self.assertEqual(self.good("pull", "car1:echo/7", env=env).out, ECHO)
        self.assertEqual(self.good("pull", "self:echo/7", "--at", self.car1, env=env).out, ECHO)

    def test_a_member_asks_at_addresses(self):
        for where in (("--at", self.car1), ("--peer", f"car1={self.car1}")):
            self.assertEqual(self.good("pull", "car1:echo/7", "-k", "fleet/operator", *where).out, ECHO)
        self.assertEqual(self.names("-k", "fleet/operator", "--at", self.car1), ["car1"])

    def test_several_processes_use_one_key_at_once(self):
        processes = [start("pull", "car1:echo/7", "-k", "fleet/operator", "-n", "3", cwd=self.scratch,
                           env=environment(CLES_MULTICAST=self.group)) for _ in range(6)]
        for process in processes:
            self.assertEqual(finish(process), (0, ECHO * 3, ""))

    def test_the_nodes_user_needs_no_key_at_its_unix_socket(self):
        self.assertEqual(self.good("pull", "car1:echo/7", "--at", f"unix://{self.path('car1.sock')}").out, ECHO)
        with socket.socket(socket.AF_UNIX) as plain:  # as nc -U
            plain.settimeout(PATIENCE)
            plain.connect(str(self.path("car1.sock")))
            plain.sendall(b"PULL car1:echo/7\n")
            self.assertEqual(plain.recv(100), ECHO.encode())

    def test_a_change_of_rights_takes_effect_without_a_restart(self):
        self.path("fleet/car1/rules").write_text("deny operator may pull *:echo/**\n", encoding="utf-8")
        os.chmod(self.path("fleet/car1/rules"), 0o600)
        wait_until(lambda: self.run_in("pull", "car1:echo/7", "-k", "fleet/operator").code == 5, "it is denied")
        self.assertIn("denied", self.run_in("pull", "car1:echo/7", "-k", "fleet/operator").err)

    def test_the_key_of_a_node_asks_that_node(self):
        car2 = self.serve("car2")
        at = ("--peer", f"car1={self.car1}")
        self.assertEqual(self.good("pull", "car1:echo/7", "-k", "fleet/car1", *at).out, ECHO)
        self.failed("pull", "car1:echo/7", "-k", "fleet/car1", "--peer", f"car1={car2}", says="another member answers there")
        self.assertEqual(self.names("-k", "fleet/car1"), ["car1", "car2"])
        states = json.loads(self.good("ls", "-k", "fleet/car1", "-o", "json").out)["peers"]
        self.assertEqual([node["state"] for node in states], ["live", "live"])

    def test_a_denial_names_the_whole_noun_here_and_in_the_log(self):
        self.good("fleet", "rights", "operator", "--may", "pull,bind *:cles", "-k", "fleet")
        for name in ("car1", "operator"):
            self.good("keys", "join", "fleet/roster", "-k", f"fleet/{name}")
        self.good("pull", "car1:cles", "-k", "fleet/operator", "--at", self.car1)
        says = "operator may not send PULL 'cles/metrics' to car1"
        self.ends_with(5, "pull", "car1:cles/metrics", "-k", "fleet/operator", "--at", self.car1, says=says)
        self.ends_with(5, "pull", "self:cles/metrics", "-k", "fleet/operator", "--at", self.car1,
                       says="car1 does not allow PULL 'cles/metrics'")
        line = self.logged("car1", "operator was denied PULL car1:cles/metrics: ")
        self.assertRegex(line, r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d info ")

    def test_the_log_names_the_address_and_the_key_of_a_stranger(self):
        self.good("fleet", "init", "other", "--with", "stranger")
        key = json.loads(self.good("keys", "show", "-k", "other/stranger", "-o", "json").out)["key"]
        self.failed("pull", "self:cles", "-k", "other/stranger", "--at", self.car1, says="not in the roster")
        self.assertIn(f"(127.0.0.1, key {key})", self.logged("car1", "not in roster"))

    def test_updates_that_would_not_count_are_not_waited_for(self):
        """A node without security at a Unix socket, whose listener is trusted, but has no key."""
        where = f"unix://{self.path('plain.sock')}"
        process = start("serve", "--name", "car2", "-l", where, cwd=self.scratch)
        self.addCleanup(self.end, process)
        self.assertEqual(read_line(process), f"car2 listening on {where}\n")
        self.ends_with(5, "bind", "car2:localization", "--duration", "10s", "-k", "fleet/operator", "--at", where,
                       says="car2 does not confirm its epoch with its signature, so its updates do not count")

    @unittest.skipIf(not os.path.exists(CLES + "-bench"), "cles-bench is not built")
    def test_a_measurement(self):
        report = json.loads(self.good("bench", "--against", self.car1, "-k", "fleet/operator", "--requests", "50",
                                      "--rounds", "1", "-o", "json").out)
        self.assertEqual(report["against"], self.car1)
        self.refused("bench", "--against", self.car1, says="give --keys DIR, or set CLES_KEYS")
        self.refused("bench", "--keys", "fleet/operator", says="needs --against")

    @unittest.skipIf(os.geteuid() != 0, "needs another user")
    def test_another_user_at_a_unix_socket_answers_only_if_that_is_stated(self):
        where = f"unix://@cles-test-{os.getpid()}"
        script = ("import os, socket, sys\n"
                  "door = socket.socket(socket.AF_UNIX)\ndoor.bind('\\0' + sys.argv[1])\ndoor.listen()\n"
                  "print('ready', flush=True)\n"
                  "while True:\n"
                  "    link, _ = door.accept()\n"
                  "    line = link.makefile('r').readline()\n"
                  "    if line:\n"
                  "        id = ''.join(word[3:] for word in line.split() if word.startswith('id='))\n"
                  "        link.sendall(f'id={id} {{\"forged\":true}}\\n'.encode() if id else b'{\"forged\":true}\\n')\n")
        other = subprocess.Popen(["python3", "-c", script, where.partition("@")[2]], user="nobody", group="nogroup",
                                 extra_groups=[], stdout=subprocess.PIPE, text=True, cwd="/")
        self.addCleanup(other.communicate)
        self.addCleanup(other.kill)
        self.assertEqual(other.stdout.readline(), "ready\n")
        command = ("pull", "self:echo/7", "-k", "fleet/operator", "--at", where)
        self.failed(*command, says="listens there, who is neither root, nor the user of this process")
        self.failed(*command, says="say which member it is: --local-user USER=MEMBER")
        self.failed("ls", "-k", "fleet/operator", "--at", where, says="listens there")
        by_name = ("pull", "car1:echo/7", "-k", "fleet/operator", "--peer", f"car1={where}", "--local-user")
        self.failed(*by_name, "nobody=car2", says="listens there")
        for accepted in ((*command, "--local-user", "nobody=car2"), (*by_name, "nobody=car1")):
            self.assertEqual(self.good(*accepted).out, '{"forged":true}\n')

    def test_the_option_local_user(self):
        for text, says in (("nobody", "write USER=MEMBER"), ("=car1", "write USER=MEMBER"), ("nobody=a b", "write USER=MEMBER"),
                           ("no_such_user=car1", "there is no user 'no_such_user'")):
            self.refused("pull", "car1:echo/7", "-k", "fleet/operator", "--local-user", text, says=says)
        nobody = pwd.getpwnam("nobody").pw_uid
        for user in ("nobody", nobody):  # each is one member
            self.refused("pull", "car1:echo/7", "-k", "fleet/operator", "--local-user", "nobody=car1", "--local-user",
                         f"{user}=car2", says="that user is car1 already")
        self.refused("pull", "car1:echo/7", "--local-user", "nobody=car1", says="give --keys DIR, or set CLES_KEYS")

    # -- what is refused -------------------------------------------------------------------------------------------

    def test_tls_needs_a_key(self):
        self.refused("pull", "self:echo/7", "--at", self.car1, says="give --keys DIR, or set CLES_KEYS")

    def test_plain_addresses_are_refused_with_a_key(self):
        for scheme in ("tcp", "udp"):
            self.refused("pull", "self:echo/7", "-k", "fleet/operator", "--at", f"{scheme}://127.0.0.1:1",
                         says="write tls://127.0.0.1:1")

    def test_a_plain_request_to_a_secured_node_is_explained(self):
        self.ends_with(5, "pull", "self:echo/7", "--at", self.car1.replace("tls", "tcp"),
                       says="answers only with --keys DIR at tls://, or at its Unix socket")

    def test_without_a_key_no_secured_node_is_found(self):
        self.ends_with(3, "pull", "car1:echo/7", says="no node with that name has announced itself")

    def test_a_node_that_was_removed_is_denied(self):
        self.good("fleet", "remove", "operator", "-k", "fleet")
        self.good("keys", "join", "fleet/roster", "-k", "fleet/car1")
        wait_until(lambda: self.run_in("pull", "self:echo/7", "-k", "fleet/operator", "--at", self.car1).code != 0,
                   "it is denied")

    def test_a_command_with_an_old_roster_gets_the_newer_one(self):
        self.serve("car2")
        self.good("fleet", "remove", "car2", "-k", "fleet")
        self.good("keys", "join", "fleet/roster", "-k", "fleet/car1")
        wait_until(lambda: json.loads(self.good("pull", "self:cles", "--at", f"unix://{self.path('car1.sock')}").out)["roster"]
                   == 3, "car1 has the newer one")
        self.assertEqual(self.json("keys", "show", "-k", "fleet/operator")["version"], 2)
        wait_until(lambda: self.names("-k", "fleet/operator") == ["car1"], "car1 is found, and car2 is not")
        self.assertEqual(self.json("keys", "show", "-k", "fleet/operator")["version"], 3)
        self.assertEqual(self.good("pull", "car1:echo/7", "-k", "fleet/operator").out, ECHO)

    def test_problems_of_the_directory(self):
        self.failed("pull", "car1:echo/7", "-k", "nowhere", says="nowhere")
        self.good("keys", "new", "sat1", "-k", "sat1")
        self.failed("pull", "car1:echo/7", "-k", "sat1", says="roster")
        os.chmod(self.path("fleet/operator/key"), 0o644)
        self.failed("pull", "car1:echo/7", "-k", "fleet/operator", says="chmod")

    # -- cles doctor -----------------------------------------------------------------------------------------------

    def findings(self, check, keys):
        """What the check found: (verdict, text, advice)."""
        done = self.run_in("doctor", "-k", keys, "-o", "json")
        return [(each["verdict"], each["text"], each.get("advice", ""))
                for each in json.loads(done.out)["findings"] if each["check"] == check]

    def finds(self, check, keys, verdict, text, advice=""):
        found = self.findings(check, keys)
        self.assertTrue(any(each[0] == verdict and text in each[1] and advice in each[2] for each in found), found)

    def test_doctor_of_a_directory_that_can_be_used(self):
        self.finds("keys", "fleet/operator", "ok", "operator is a member of the fleet")
        self.finds("nodes", "fleet/operator", "ok", "1 node found")
        self.finds("nodes", "fleet/operator", "ok", "version 2 of the roster is in force")

    def test_doctor_of_a_directory_with_mistakes(self):
        self.finds("keys", "nowhere", "failure", "nowhere")
        self.good("keys", "new", "sat1", "-k", "sat1")
        self.finds("keys", "sat1", "failure", "sat1 is not a member of a fleet: there is no roster", "cles fleet add")
        self.path("fleet/operator/rules").write_text("allow everything\n", encoding="utf-8")
        self.finds("keys", "fleet/operator", "failure", "every request is denied", "cles access")
        os.chmod(self.path("fleet/operator/key"), 0o644)
        self.finds("keys", "fleet/operator", "failure", "chmod", "cles keys show")

    def test_doctor_of_a_fork(self):
        fork = self.path("fork")
        shutil.copytree(self.path("fleet"), fork)
        self.good("fleet", "rotate", "-k", "fleet")
        self.good("fleet", "remove", "car2", "-k", "fork")
        shutil.copy(self.path("fork/roster"), self.path("fleet/operator/other.join"))
        self.good("keys", "join", "fleet/roster", "-k", "fleet/operator")
        self.finds("keys", "fleet/operator", "warning", "other.join", "cles fleet rotate")

    # -- cles serve ------------------------------------------------------------------------------------------------

    def test_serve_takes_the_name_of_its_key(self):
        self.refused("serve", "-k", "fleet/car2", "--name", "car3", "-l", "tls://127.0.0.1:0", says="'car2'")
        self.serve("car2")
        self.assertEqual(self.names("-k", "fleet/operator"), ["car1", "car2"])


if __name__ == "__main__":
    unittest.main()
