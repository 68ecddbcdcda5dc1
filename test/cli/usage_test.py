#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Invalid arguments, each with a message that says why; help and version."""

import tempfile
import unittest

from support import HAS_SECURITY, cles, environment, finish, on_terminal, read_line, start

COMMANDS = ("pull", "push", "delegate", "bind", "update", "ping", "hz", "info", "ls", "top", "doctor", "completion",
            "serve", "publish", "respond", "jobs", "sniff", "context", "gateway")
if HAS_SECURITY:
    COMMANDS += ("keys", "fleet", "access")


class Usage(unittest.TestCase):
    def refused(self, *arguments, says="", **options):
        code, out, err = cles(*arguments, **options)
        self.assertEqual((code, out), (2, ""), (arguments, err))
        self.assertTrue(err.startswith("cles: "), err)
        self.assertIn(says, err, arguments)

    def test_commands(self):
        self.refused(says="subcommand")
        self.refused("fly", says="there is no command 'fly'")
        self.refused("pull", says="noun")
        self.refused("pull", "car1:a", "car1:b", says="car1:b")
        self.refused("pull", "car1:a", "--fast", says="--fast")

    def test_nouns(self):
        for noun, says in (("car1", "NODE:TASK"), (":a", "the node"), ("car1:", "the task"), ("car 1:a", "the node"),
                           ("car1:a b", "the task"), ("car1:a/", "empty"), ("car1:a//b", "empty"), ("car1:a/b c", "b c"),
                           ("car1:a/%2", "%2"), ("car1:a/%zz", "%zz"), ("car1:a/ä", "%HH"), ("x" * 65 + ":a", "64"),
                           ("car1:a/b id=1", "id=1"), ("car1:a/%00", "'%00' is not text"),
                           ("car1:a/%0A", "not text"), ("car1:a/%C2%85", "not text"), ("car1:a/%ff", "UTF-8"),
                           ("car1:a" + "/b" * 33, "32 parameters"), ("car1:a\nPULL self:b", "the task")):
            for command in ("pull", "push", "bind", "hz"):
                self.refused(command, noun, says=says)

    def test_bodies(self):
        self.refused("push", "car1:a", "-d", '{"a":}', says="at byte 5")
        self.refused("push", "car1:a", "-d", '{"a":1', says="the body is not valid JSON")
        self.refused("push", "car1:a", "-d", '{"a":01}', says="leading zeros")
        self.refused("push", "car1:a", "-d", "7", says="an object or an array")
        self.refused("push", "car1:a", "-d", "", says="the body is not valid JSON")
        self.refused("push", "car1:a", "-d", "[" * 33 + "]" * 33, says="32")
        self.refused("push", "car1:a", "-d", "-", stdin="", says="the body from stdin is not valid JSON")
        self.refused("push", "car1:a", "-d", "-", stdin="{,}", says="the body from stdin is not valid JSON")
        self.refused("push", "car1:a", "-d", "@/nowhere/x.json", says="cannot read /nowhere/x.json: No such file")
        self.refused("push", "car1:a", "-d", "@/", says="cannot read /: Is a directory")
        with tempfile.NamedTemporaryFile("w") as empty:
            self.refused("push", "car1:a", "-d", "@" + empty.name, says=f"{empty.name} is not valid JSON")

    def test_verbs_without_a_body(self):
        self.refused("pull", "car1:a", "-d", "{}", says="PULL takes no body")
        self.refused("bind", "car1:a", "-d", "{}", says="BIND takes no body")

    def test_addresses(self):
        self.refused("pull", "car1:a", "--at", "localhost", says="localhost")
        self.refused("pull", "car1:a", "--at", "tcp://", says="tcp://")
        self.refused("pull", "car1:a", "--at", "tcp://h:99999", says="99999")
        self.refused("pull", "car1:a", "--at", "pigeon://x", says="pigeon")
        self.refused("pull", "car1:a", "--peer", "car1", says="NAME=URL")
        self.refused("pull", "car1:a", "--peer", "self=tcp://127.0.0.1", says="self")
        self.refused("pull", "car1:a", "--peer", "car1=nowhere", says="nowhere")
        self.refused("pull", "car1:a", env=environment(CLES_AT="nowhere"), says="nowhere")
        self.refused("ping", "a b", says="neither")
        self.refused("info", "a b", says="neither")

    def test_numbers(self):
        for text in ("x", "", "-1s", "1h30", "5 s", "1d", "inf", "nan", "1e3", "0x10"):
            self.refused("pull", "car1:a", f"--timeout={text}", says="" if text == "" else "not a duration")
        self.refused("pull", "car1:a", "-t", "soon", says="write 500ms, 2s, 1min, 1h")
        for text in ("500us", "1.5ms", "0.0001", "1500us"):
            for command in (("pull", "car1:a", "-t"), ("bind", "car1:a", "--every"), ("ls", "-w"), ("top", "-i")):
                self.refused(*command, text, says="not a whole number of milliseconds")
        self.refused("pull", "car1:a", "-t", "0", says="too short")
        self.refused("pull", "car1:a", "-t", "90000", says="longer than a day")
        self.refused("pull", "car1:a", "-i", "soon", says="not a duration")
        for text in ("x", "-1", "1.5"):
            self.refused("pull", "car1:a", "-n", text, says="--count")
        self.refused("bind", "car1:a", "--keep", "0", says="--keep")
        self.refused("bind", "car1:a", "--every", "x", says="not a duration")
        self.refused("hz", "car1:a", "-w", "0", says="--window")
        for option in ("--busy-poll", "--wake-within"):
            for command in ("serve", "bench"):
                self.refused(command, option, "soon", says="write 50us")
                self.refused(command, option, "2s", says="longer than a second")

    def test_units(self):
        for text in ("1h", "1.5h", "2min", "3s", "1.001s", "20ms", "20000us", "2"):
            code, _, err = cles("pull", "self:a", "--at", "tcp://127.0.0.1:1", "-t", text, "-i", text)
            self.assertEqual(code, 1, err)  # nobody is there
        for text in ("50us", "1ms", "50"):
            self.refused("serve", "--busy-poll", text, "--listen", "inproc://x", says="inproc")

    def test_what_a_binding_is_for(self):
        for command in ("bind", "hz", "sniff"):
            self.refused(command, "any:a", says="needs the name of one, or all")
            self.refused(command, "car1:a", "any:*", says="needs the name of one, or all")
            self.refused(command, "car1:**/a", says="the last part")
            self.assertIn("NODE may be self or all", cles("help", command)[1])
            self.assertEqual(cles("__complete", command, "an")[1], "")
        self.assertIn("NODE may be self, any or all", cles("help", "pull")[1])
        self.assertIn("any:", cles("__complete", "pull", "an")[1])

    def test_names_of_options(self):
        for option in ("--name", "--node"):
            node = start("serve", option, "car9", "--listen", "tcp://127.0.0.1:0")
            self.assertRegex(read_line(node), "^car9 listening on ")
            node.terminate()
            self.assertEqual(finish(node)[0], 0)

    def test_top(self):
        self.refused("top", "-i", "50ms", says="too short")
        self.refused("top", "--sort", "size", says="size")
        self.refused("top", says="--multicast IFACE")

    def test_tasks(self):
        for text in ("a b", "fly:echo", "pull:", ":echo", "pull:a:b"):
            self.refused("ls", "--offers", text, says="VERB:TASK")

    def test_forms_of_output(self):
        self.refused("pull", "car1:a", "-o", "xml", says="xml")
        for command in ("pull", "push", "delegate", "update", "bind", "ping", "hz", "info", "ls", "top", "trace", "doctor",
                        "bench"):
            text = " ".join(cles("help", command)[1].split())
            self.assertRegex(text, r"-o,--output FORMAT table, json (\(one document per line\) )?or raw", command)
            self.assertEqual(cles("__complete", command, "--output", "")[1].split(), ["table", "json", "raw"], command)

    def test_help(self):
        code, out, err = cles("--help")
        self.assertEqual((code, err), (0, ""))
        for command in COMMANDS:
            self.assertIn(f"  {command} ", out)
            code, text, err = cles(command, "--help")
            self.assertEqual((code, err), (0, ""), command)
            self.assertIn("Examples:", text)
            self.assertIn(f"cles {command}", text)
        self.assertIn("Exit codes:", out)

    def test_help_fits_the_terminal(self):
        for width in (60, 80, 132):
            for command in ((), ("pull",), ("serve",), ("doctor",), ("bench",)):
                code, shown = on_terminal("help", *command, columns=width)
                self.assertEqual(code, 0)
                text = shown.replace("\r\n", "\n").split("\nExamples:")[0]
                words = [line for line in text.split("\n") if len(line) > width and " " in line.strip()]
                self.assertEqual(words, [], command)
                self.assertEqual(text.split(), cles("help", *command)[1].split("\nExamples:")[0].split())

    def test_help_as_a_command(self):
        self.assertEqual(cles("help"), cles("--help"))
        for command in (*COMMANDS, "help"):
            self.assertEqual(cles("help", command), cles(command, "--help"))
        self.refused("help", "pul", says="did you mean 'cles pull'?")

    def test_nothing_at_all_shows_what_there_is(self):
        code, out, err = cles()
        self.assertEqual((code, out), (2, ""))
        for command in COMMANDS:
            self.assertIn(f"  {command} ", err)

    def test_what_was_probably_meant(self):
        for typed, meant in (("pul", "pull"), ("bnid", "bind"), ("subscribe", None), ("del", "delegate"), ("lst", "ls")):
            code, _, err = cles(typed, "car1:a")
            self.assertEqual(code, 2)
            self.assertEqual(f"did you mean 'cles {meant}'?" in err, meant is not None, err)
        for command, typed, meant in (("bind", "--ever", "--every"), ("pull", "--timout=2s", "--timeout"),
                                      ("ls", "--verbos", "--verbose")):
            self.refused(command, "car1:a", typed, says=f"did you mean '{meant}'?")
        code, _, err = cles("pull", "car1:a", "--colour")
        self.assertEqual(code, 2)
        self.assertNotIn("did you mean", err)

    def test_version(self):
        code, out, err = cles("--version")
        self.assertEqual((code, err), (0, ""))
        self.assertRegex(out, r"^cles \d+\.\d+\.\d+\n$")


if __name__ == "__main__":
    unittest.main()
