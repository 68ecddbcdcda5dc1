#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles respond`: a node that answers the requests of a task, by a body or a program."""

import json
import os
import re
import signal
import socket
import tempfile
import time
import unittest

from support import HAS_SECURITY, cles, finish, read_line, start, wait_until


class Responder:
    """A `cles respond` on a free port."""

    def __init__(self, *arguments, **options):
        self.process = start("respond", *arguments, **options)
        line = read_line(self.process)
        self.url = re.search(r"(tcp|tls)://\S+", line).group(0)
        self.name = line.split(" ")[0]

    def ask(self, *arguments, **options):
        return cles(*arguments, "--at", self.url, **options)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            finish(self.process)


def script(folder, name, text):
    """An executable file, to be written into --exec."""
    path = os.path.join(folder, name)
    with open(path, "w", encoding="utf-8") as file:
        file.write("#!/bin/sh\n" + text)
    os.chmod(path, 0o755)
    return f"'{path}'"


def is_running(pid):
    try:
        with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
            return file.read().rsplit(") ", 1)[1][0] != "Z"
    except FileNotFoundError:
        return False


class Fixed(unittest.TestCase):
    def test_every_verb(self):
        for verb in ("pull", "push", "delegate", "update"):
            with Responder(verb, "speed", "-d", '{"value": 27.8}', "--name", "car1") as node:
                code, out, err = node.ask(verb, "car1:speed/a")
                self.assertEqual((code, out), (0, '{"value":27.8}\n'), err)

    def test_it_is_described(self):
        with Responder("PULL", "speed", "-d", "{}") as node:
            self.assertRegex(node.name, r"^cles-\d+$")
            tasks = json.loads(node.ask("pull", "self:cles")[1])["tasks"]
            self.assertEqual([(task["verb"], task["task"]) for task in tasks], [("PULL", "speed")])


class Commands(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def respond(self, text, *arguments, verb="delegate"):
        return Responder(verb, "work", "--exec", script(self.folder, "work", text), "--name", "car1", *arguments)

    def test_body_and_parameters_reach_it(self):
        with self.respond('read body\nprintf \'{"body":%s,"with":"%s"}\\n\' "$body" "$*"\n', "--parameters") as node:
            code, out, err = node.ask("delegate", "car1:work/-v/b%20c", "-d", '{"a": 1}')
            self.assertEqual((code, out), (0, '{"body":{"a":1},"with":"-- -v b c"}\n'), err)

    def test_no_shell_reads_the_command(self):
        with Responder("pull", "work", "--exec", "printf '{\"at\":\"%s\"}' $HOME;id", "--name", "car1") as node:
            self.assertEqual(node.ask("pull", "car1:work"), (0, '{"at":"$HOME;id"}\n', ""))

    def test_parameters_do_not_reach_a_command_that_is_not_made_for_them(self):
        path = os.path.join(self.folder, "secret")
        with open(path, "w", encoding="utf-8") as file:
            file.write('{"a":"secret"}')
        with Responder("push", "work", "--exec", "cat", "--name", "car1") as node:
            self.assertEqual(node.ask("push", "car1:work", "-d", "{}"), (0, "{}\n", ""))
            code, out, err = node.ask("push", "car1:work/" + path.replace("/", "%2F"), "-d", "{}")
            self.assertEqual((code, out), (5, ""))
            self.assertIn("bad_request: car1: 'work' takes no parameters", err)

    def test_parameters_that_are_too_long_for_a_command(self):
        with self.respond("echo '{}'\n", "--parameters") as node:
            host, port = node.url.removeprefix("tcp://").split(":")
            with socket.create_connection((host, int(port)), timeout=20) as link, link.makefile("rw", encoding="utf-8") as lines:
                lines.write("DELEGATE car1:work/" + "x" * 200_000 + " id=1\n")
                lines.flush()
                self.assertIn('"error":"too_large"', lines.readline())

    def test_what_has_left_the_group_and_goes_on_printing(self):
        with self.respond("setsid yes &\n") as node:
            for _ in range(2):
                self.assertNotEqual(node.ask("delegate", "car1:work", "-t", "20s")[0], 4)
            node.process.send_signal(signal.SIGTERM)
            self.assertEqual(finish(node.process)[0], 0)

    def test_exit_codes_are_failures(self):
        with self.respond('echo "the reason $2"\nexit "$2"\n', "--parameters") as node:
            for number, code, name in ((1, 5, "failed"), (2, 5, "bad_request"), (3, 3, "no_task"), (4, 4, "deadline"),
                                       (6, 6, "busy"), (69, 5, "unavailable"), (77, 5, "denied")):
                got, out, err = node.ask("delegate", f"car1:work/{number}")
                self.assertEqual((got, out), (code, ""), (number, err))
                self.assertTrue(err.startswith(f"cles: {name}: car1: the reason {number}\n"), err)

    def test_what_it_prints_has_to_be_json(self):
        with self.respond("echo hello\n") as node:
            code, _, err = node.ask("delegate", "car1:work")
            self.assertEqual(code, 5)
            self.assertIn("failed: car1: the command has printed something that is no JSON", err)

    def test_a_large_body_and_a_large_result(self):
        with self.respond("cat\n") as node:
            body = json.dumps({"a": "x" * 500_000})
            code, out, err = node.ask("delegate", "car1:work", "-d", "-", stdin=body)
            self.assertEqual(code, 0, err)
            self.assertEqual(json.loads(out), json.loads(body))
        with self.respond("exec yes\n") as node:
            code, _, err = node.ask("delegate", "car1:work")
            self.assertEqual(code, 5)
            self.assertIn("too_large: ", err)

    def test_it_need_not_read_its_body(self):
        with self.respond("exit 0\n") as node:
            self.assertEqual(node.ask("delegate", "car1:work", "-d", json.dumps({"a": "x" * 100_000})),
                             (0, "{}\n", ""))

    def test_as_many_run_at_once_as_are_allowed(self):
        text = f"echo >>'{self.folder}/started'\nwhile ! test -e '{self.folder}/go'; do sleep 0.02; done\n"
        with self.respond(text, "--jobs", "2") as node:
            clients = [start("delegate", "car1:work", "--at", node.url) for _ in range(3)]

            def states():
                jobs = json.loads(node.ask("pull", "self:cles/jobs")[1])["jobs"]
                return sorted(job["state"] for job in jobs)

            wait_until(lambda: states() == ["queued", "running", "running"], "two run and one waits")
            with open(f"{self.folder}/started", encoding="utf-8") as file:
                self.assertLessEqual(len(file.readlines()), 2)
            with open(f"{self.folder}/go", "w", encoding="utf-8"):
                pass
            self.assertEqual([finish(client)[0] for client in clients], [0, 0, 0])

    def pid_of(self):
        path = f"{self.folder}/pid"
        wait_until(lambda: os.path.exists(path) and os.path.getsize(path) > 0, "the command runs")
        with open(path, encoding="utf-8") as file:
            return int(file.read())

    def test_it_is_stopped_with_its_request(self):
        # With a child, and deaf to SIGTERM.
        with self.respond(f"trap '' TERM\nsleep 1000 &\necho $! >'{self.folder}/pid'\nwait\nsleep 1000\n") as node:
            client = start("delegate", "car1:work", "--at", node.url)
            pid = self.pid_of()
            client.send_signal(signal.SIGINT)
            self.assertEqual(finish(client)[0], 130)
            wait_until(lambda: not is_running(pid), "the command and its child are gone")
            os.remove(f"{self.folder}/pid")
            begun = time.monotonic()
            code, _, err = node.ask("delegate", "car1:work", "-t", "2s")
            self.assertEqual(code, 4, err)
            self.assertLess(time.monotonic() - begun, 20)
            pid = self.pid_of()
            wait_until(lambda: not is_running(pid), "it ends with its deadline")

    def test_it_ends_with_the_node(self):
        with self.respond(f"sleep 1000 &\necho $! >'{self.folder}/pid'\nwait\n") as node:
            client = start("delegate", "car1:work", "--at", node.url)
            pid = self.pid_of()
            node.process.send_signal(signal.SIGTERM)
            self.assertEqual(finish(node.process)[0], 0)
            self.assertNotEqual(finish(client)[0], 0)
            wait_until(lambda: not is_running(pid), "the command ends with its node")

    def test_a_command_that_is_missing_fails(self):
        with Responder("pull", "work", "--exec", "/nowhere/program", "--name", "car1") as node:
            code, _, err = node.ask("pull", "car1:work")
            self.assertEqual(code, 5)
            self.assertIn("failed: car1: the command cannot be started", err)
            self.assertNotIn("/nowhere", err)


class Refused(unittest.TestCase):
    def test_arguments(self):
        for arguments, says in ((("bind", "a", "-d", "{}"), "bind"), (("pull", "a b", "-d", "{}"), "the name of a task"),
                                (("pull", "a"), "Give either"), (("pull", "a", "-d", "{}", "--exec", "x"), "Give either"),
                                (("pull", "a", "-d", "7"), "an object or an array"), (("pull", "a", "--exec", ""), "no program"),
                                (("pull", "a", "--exec", "x", "--jobs", "0"), "--jobs")):
            code, out, err = cles("respond", *arguments)
            self.assertEqual((code, out), (2, ""), (arguments, err))
            self.assertIn(says, err, arguments)


@unittest.skipUnless(HAS_SECURITY, "cles was built without libsodium")
class Secured(unittest.TestCase):
    def test_a_member_answers_members(self):
        with tempfile.TemporaryDirectory() as folder:
            fleet = os.path.join(folder, "fleet")
            code, _, err = cles("fleet", "init", fleet, "--with", "car1,car2")
            self.assertEqual(code, 0, err)
            with Responder("pull", "speed", "-d", "[7]", "--keys", f"{fleet}/car1", "--listen",
                           "tls://127.0.0.1:0") as node:
                self.assertEqual(node.name, "car1")
                self.assertEqual(node.ask("pull", "car1:speed", "--keys", f"{fleet}/car2"), (0, "[7]\n", ""))
                self.assertNotEqual(node.ask("pull", "car1:speed")[0], 0)


if __name__ == "__main__":
    unittest.main()
