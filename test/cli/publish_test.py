#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles publish`: a node that publishes a body, the lines of stdin, or what a program prints."""

import json
import os
import re
import signal
import subprocess
import tempfile
import unittest

from support import CLES, HAS_SECURITY, PATIENCE, cles, environment, finish, read_line


class Publisher:
    """A `cles publish` on a free port, with a pipe as its stdin."""

    def __init__(self, *arguments, env=None):
        self.process = subprocess.Popen([CLES, "publish", *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True, env=env or environment())
        line = read_line(self.process)
        self.url = re.search(r"(tcp|tls|unix)://\S+", line).group(0)
        self.name = line.split(" ")[0]

    def read_error(self, part):
        """The next line of its log, and of what it reports, that contains this."""
        line = read_line(self.process, self.process.stderr)
        while part not in line:
            if not line:
                raise AssertionError(f"it did not say {part!r}")
            line = read_line(self.process, self.process.stderr)
        return line

    def write(self, text):
        self.process.stdin.write(text)
        self.process.stdin.flush()

    def bind(self, noun, *arguments):
        code, out, err = cles("bind", noun, *arguments, "--at", self.url)
        if code != 0:
            raise AssertionError(err)
        return out

    def end(self, number=signal.SIGTERM):
        self.process.send_signal(number)
        return finish(self.process)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()


class Bodies(unittest.TestCase):
    def test_a_body_can_be_bound_until_the_node_ends(self):
        with Publisher("car1:notice", "-d", '{"text": "road closed"}') as node:
            self.assertEqual(node.name, "car1")
            self.assertEqual(node.bind("car1:notice", "-n", "1"), '{"text":"road closed"}\n')
            code, _, err = node.end()
            self.assertEqual(code, 0, err)

    def test_it_is_repeated(self):
        with Publisher("car1:notice/a%20b", "-d", "[7]", "--rate", "100") as node:
            self.assertEqual(node.bind("car1:notice/a%20b", "-n", "3"), "[7]\n" * 3)

    def test_it_ends_after_a_number_of_updates(self):
        with Publisher("self:notice", "-d", "[7]", "--rate", "100", "-n", "3", "--name", "car7") as node:
            self.assertEqual(node.name, "car7")
            self.assertEqual(finish(node.process)[0], 0)

    def test_its_nouns_are_told(self):
        with Publisher("car1:notice", "-d", "[7]") as node:
            code, out, err = cles("pull", "car1:cles/nouns", "--at", node.url)
            self.assertEqual((code, out), (0, '{"nouns":["notice"]}\n'), err)


class Lines(unittest.TestCase):
    def test_each_line_is_an_update(self):
        with Publisher("car1:speed") as node:
            node.write('{"v":1}\n')
            reader = subprocess.Popen([CLES, "bind", "car1:speed", "-n", "3", "--at", node.url], stdout=subprocess.PIPE,
                                      stderr=subprocess.PIPE, text=True, env=environment())
            self.assertEqual(read_line(reader), '{"v":1}\n')
            node.write('\n{"v": 2}\n{"v":\n')
            self.assertEqual(read_line(reader), '{"v":2}\n')
            self.assertIn("cles: not published: line 4 of stdin is not valid JSON: ", node.read_error("published"))
            node.process.stdin.write('{"v":3}')  # the last line need not end
            node.process.stdin.close()
            self.assertEqual(finish(reader)[1], '{"v":3}\n')
            self.assertEqual(node.process.wait(PATIENCE), 2)
            node.process.stdout.close()
            node.process.stderr.close()

    def test_it_can_stay_after_the_last(self):
        with Publisher("car1:speed", "--stay") as node:
            node.write('{"v":1}\n')
            node.process.stdin.close()
            self.assertEqual(node.bind("car1:speed", "-n", "1"), '{"v":1}\n')
            node.process.stdin = None
            self.assertEqual(node.end()[0], 0)

    def test_interrupt(self):
        with Publisher("car1:speed") as node:
            code, _, err = node.end(signal.SIGINT)
            self.assertEqual(code, 0, err)
            self.assertNotIn("cancel", err.lower())

    def test_a_file_is_published_at_a_rate(self):
        with tempfile.NamedTemporaryFile("w", suffix=".jsonl") as file:
            file.write("".join(json.dumps({"n": n}) + "\n" for n in range(100_000)))
            file.flush()
            with open(file.name, encoding="utf-8") as lines:
                process = subprocess.Popen([CLES, "publish", "car1:n", "--rate", "50"], stdin=lines, stdout=subprocess.PIPE,
                                           stderr=subprocess.PIPE, text=True, env=environment())
            url = re.search(r"tcp://\S+", read_line(process)).group(0)
            out = cles("bind", "car1:n", "-n", "5", "--at", url)[1]
            numbers = [json.loads(line)["n"] for line in out.splitlines()]
            self.assertEqual(numbers, list(range(numbers[0], numbers[0] + 5)))
            process.send_signal(signal.SIGTERM)
            self.assertEqual(finish(process)[0], 0)


class Commands(unittest.TestCase):
    def test_what_a_command_prints_is_published(self):
        with tempfile.TemporaryDirectory() as folder:
            script = os.path.join(folder, "count")
            with open(script, "w", encoding="utf-8") as file:
                file.write("#!/bin/sh\necho x >>'%s/runs'\nprintf '{\"runs\":%%d, \"with\":\"%%s\"}\\n' "
                           "$(wc -l <'%s/runs') \"$1\"\n" % (folder, folder))
            os.chmod(script, 0o755)
            with Publisher("car1:count", "--exec", f"'{script}' 'a b'", "--rate", "20") as node:
                first, second = (json.loads(line) for line in node.bind("car1:count", "-n", "2").splitlines())
                self.assertEqual(second["runs"], first["runs"] + 1)
                self.assertEqual(first["with"], "a b")
                self.assertEqual(node.end()[0], 0)

    def test_a_command_that_fails_publishes_nothing(self):
        with Publisher("car1:count", "--exec", "false", "--rate", "50") as node:
            self.assertEqual(node.read_error("published"),
                             "cles: not published: the command has ended with exit code 1\n")

    def test_a_command_that_is_missing_ends_the_node(self):
        code, _, err = cles("publish", "car1:count", "--exec", "/nowhere/program")
        self.assertEqual(code, 1)
        self.assertIn("cles: cannot start the command: No such file or directory\n", err)


class Refused(unittest.TestCase):
    def test_arguments(self):
        for arguments, says in ((("any:a", "-d", "{}"), "one node"), (("car1:a", "-d", "{}", "--exec", "x"), "combined"),
                                (("car1:a", "-d", "7"), "an object or an array"), (("car1", "-d", "{}"), "NODE:TASK"),
                                (("car1:a", "--exec", "'x"), "does not end"), (("car1:a", "--rate", "0"), "--rate"),
                                (("car1:a", "-d", "{}", "--name", "car2"), "the name of this node is car2")):
            code, out, err = cles("publish", *arguments)
            self.assertEqual((code, out), (2, ""), (arguments, err))
            self.assertIn(says, err, arguments)


@unittest.skipUnless(HAS_SECURITY, "cles was built without libsodium")
class Secured(unittest.TestCase):
    def test_a_member_publishes(self):
        with tempfile.TemporaryDirectory() as folder:
            fleet = os.path.join(folder, "fleet")
            code, _, err = cles("fleet", "init", fleet, "--with", "car1,car2")
            self.assertEqual(code, 0, err)
            with Publisher("car1:notice", "-d", "[7]", "--keys", f"{fleet}/car1", "--listen",
                           "tls://127.0.0.1:0") as node:
                code, out, err = cles("bind", "car1:notice", "-n", "1", "--at", node.url, "--keys", f"{fleet}/car2")
                self.assertEqual((code, out), (0, "[7]\n"), err)

    def test_a_member_publishes_at_a_unix_socket(self):
        """What listens there has not proved which node it is."""
        with tempfile.TemporaryDirectory() as folder:
            fleet = os.path.join(folder, "fleet")
            code, _, err = cles("fleet", "init", fleet, "--with", "car1,car2")
            self.assertEqual(code, 0, err)
            for noun, rate, count in (("car1:notice", (), 1), ("car1:notice", ("--rate", "50"), 3),
                                      ("self:notice", ("--rate", "50"), 3)):
                with self.subTest(noun=noun, count=count), \
                        Publisher("car1:notice", "-d", "[7]", *rate, "--keys", f"{fleet}/car1", "--listen",
                                  f"unix://{folder}/car1.sock") as node:
                    code, out, err = cles("bind", noun, "-n", str(count), "--duration", "10s", "--at", node.url, "--keys",
                                          f"{fleet}/car2")
                    self.assertEqual((code, out), (0, "[7]\n" * count), err)
                    self.assertEqual(node.end()[0], 0)


if __name__ == "__main__":
    unittest.main()
