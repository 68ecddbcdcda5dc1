#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles bind`, `hz`, `ping`, `info`: what they show, and how they end."""

import json
import signal
import unittest

from support import (PATIENCE, NodeTest, ScriptedNode, cles, environment, finish, free_port, id_of, read_line, start,
                     wait_until)


class Bind(NodeTest):
    ARGUMENTS = ("--rate", "50")

    def test_count(self):
        lines = self.run_ok("bind", "car1:localization", "-n", "3").splitlines()
        times = [json.loads(line)["utc"] for line in lines]
        self.assertEqual(len(times), 3)
        self.assertEqual(times, sorted(times))

    def test_table_has_one_header(self):
        lines = self.run_ok("bind", "car1:localization", "-n", "3", "-o", "table").splitlines()
        self.assertEqual(lines[0].split(), ["seq", "utc", "lat", "lon", "velocity", "acceleration"])
        self.assertEqual(len(lines), 4)
        self.assertEqual(int(lines[3].split()[0]), int(lines[2].split()[0]) + 1)

    def test_every(self):
        lines = self.run_ok("bind", "car1:localization", "--every", "100ms", "-n", "4").splitlines()
        times = [json.loads(line)["utc"] for line in lines]
        self.assertGreater(times[3] - times[1], 0.15)

    def test_duration_ends_it(self):
        out = self.run_ok("bind", "car1:localization", "--duration", "300ms")
        self.assertTrue(out.count("\n") >= 2, out)

    def test_sees_updates_that_others_ask_for(self):
        self.run_ok("update", "car1:notice", "-d", '{"text":"hi"}')
        process = start("bind", "car1:notice", "-n", "2", "--at", self.node.url)
        # Only an update shows that the binding exists.
        for _ in range(200):
            self.run_ok("update", "car1:notice", "-d", '{"text":"hi"}')
            if process.poll() is not None:
                break
        code, out, err = finish(process)
        self.assertEqual((code, out, err), (0, '{"text":"hi"}\n' * 2, ""))

    def test_interrupt(self):
        process = start("bind", "car1:localization", "--at", self.node.url)
        self.assertIn('"utc"', read_line(process))
        process.send_signal(signal.SIGINT)
        code, _, err = finish(process)
        self.assertEqual((code, err), (130, ""))

    def test_a_reader_that_leaves_ends_it_quietly(self):
        self.run_ok("update", "car1:notice", "-d", '{"text":"last"}')
        # There are no further notices; it must still detect that its reader has closed.
        for noun in ("car1:localization", "car1:notice"):
            process = start("bind", noun, "--at", self.node.url)
            self.assertTrue(read_line(process))
            process.stdout.close()
            code = process.wait(PATIENCE)
            self.assertEqual((code, process.stderr.read()), (0, ""))
            process.stderr.close()


class Feeds(unittest.TestCase):
    """Feeds of a publisher that follows a script."""

    @staticmethod
    def updates(line, send, numbers, body='{"n":%d}'):
        if line.startswith("BIND"):
            send(id_of(line) + "{}")
            for n in numbers:
                send(f"UPDATE car1:x seq={n} epoch=00000001 " + body % n)

    def test_gaps_are_told_on_stderr(self):
        with ScriptedNode(lambda line, send: self.updates(line, send, (5, 6, 10))) as node:
            code, out, err = cles("bind", "car1:x", "-n", "3", "--at", node.url)
        self.assertEqual((code, out), (0, '{"n":5}\n{"n":6}\n{"n":10}\n'))
        self.assertEqual(err, "cles: car1:x: gap: 3 updates missed\n")

    def test_raw_is_as_it_came(self):
        with ScriptedNode(lambda line, send: self.updates(line, send, (1,), '{ "n" : %d.0 }')) as node:
            code, out, _ = cles("bind", "car1:x", "-n", "1", "-o", "raw", "--at", node.url)
        self.assertEqual((code, out), (0, '{ "n" : 1.0 }\n'))

    def test_options_cross_the_wire(self):
        with ScriptedNode(lambda line, send: self.updates(line, send, (1,))) as node:
            code, _, _ = cles("bind", "car1:x", "-n", "1", "--every", "1s", "--keep", "7", "--at", node.url)
            wait_until(node.closed.is_set, "the end of the link")
        self.assertEqual(code, 0)
        self.assertIn(" every=1000", node.lines[0])
        self.assertIn(" keep=7", node.lines[0])

    def test_a_lost_publisher_is_told_of(self):
        def answer(line, send):
            self.updates(line, send, (1,))
            return "close"

        with ScriptedNode(answer) as node:
            process = start("bind", "car1:x", "--at", node.url)
            self.assertEqual(read_line(process), '{"n":1}\n')
            line = read_line(process, process.stderr)
            self.assertTrue(line.startswith("cles: car1:x: lost: ") and line.endswith("; binding again\n"), line)
            process.send_signal(signal.SIGINT)
            self.assertEqual(finish(process)[0], 130)

    def test_a_table_is_as_wide_as_what_comes(self):
        values = ('{"name":"a","v":1.5}', '{"name":"b","v":-22.25}', '{"name":"longer","v":3}', '{"name":"c","v":4.125}')

        def answer(line, send):
            if line.startswith("BIND"):
                send(id_of(line) + "{}")
                for n, value in enumerate(values, 9):
                    send(f"UPDATE car1:x seq={n} epoch=00000001 {value}")

        with ScriptedNode(answer) as node:
            code, out, _ = cles("bind", "car1:x", "-n", "4", "-o", "table", "--at", node.url)
        self.assertEqual(code, 0)
        self.assertEqual(out, "seq  name       v\n"
                              "  9  a        1.5\n"
                              " 10  b     -22.25\n"
                              "\n"
                              "seq  name         v\n"
                              " 11  longer       3\n"
                              " 12  c        4.125\n")

    def test_refused(self):
        with ScriptedNode(lambda line, send: send(id_of(line) + '{"error":"busy","message":"full"}')) as node:
            code, out, err = cles("bind", "car1:x", "--at", node.url)
        self.assertEqual((code, out, err), (6, "", "cles: busy: full\n"))


class Many(NodeTest):
    """Several nouns, and patterns."""

    ARGUMENTS = ("--rate", "50")

    def read(self, *arguments):
        return [json.loads(line) for line in self.run_ok("bind", *arguments).splitlines()]

    def test_each_update_has_its_noun(self):
        self.run_ok("update", "car1:notice", "-d", '{"text":"hi"}')
        items = self.read("car1:localization", "car1:notice", "-n", "20")
        self.assertEqual({(item["node"], item["noun"]) for item in items}, {("car1", "localization"), ("car1", "notice")})
        self.assertEqual([item["update"] for item in items if item["noun"] == "notice"], [{"text": "hi"}])
        out = self.run_ok("bind", "car1:localization", "car1:notice", "-n", "5", "-o", "table")
        self.assertIn("NOUN", out.splitlines()[0].split())
        self.assertIn("car1:localization", out)

    def test_a_pattern_is_what_a_node_publishes(self):
        self.run_ok("update", "car1:notice", "-d", '{"text":"hi"}')
        for pattern in ("car1:**", "self:**", "all:**", "c*1:*"):
            nouns = {item["noun"] for item in self.read(pattern, "-n", "20")}
            self.assertEqual(nouns, {"localization", "notice"}, pattern)
        for pattern in ("car1:loc*", "all:l*n"):
            self.assertEqual({item["noun"] for item in self.read(pattern, "-n", "3")}, {"localization"}, pattern)

    def test_a_pattern_that_nothing_matches(self):
        for pattern in ("car1:nothing*", "truck*:**"):
            code, out, err = self.run_at("bind", pattern)
            self.assertEqual((code, out), (3, ""), err)
            self.assertIn("nobody publishes a noun that matches", err)
        for pattern in ("car1:**", "all:**"):
            code, out, err = cles("bind", pattern, "--at", "tcp://127.0.0.1:1")
            self.assertEqual((code, out), (1, ""), err)
        process = start("sniff", "--at", "tcp://127.0.0.1:1")
        self.assertIn("; still trying", read_line(process, process.stderr))
        process.send_signal(signal.SIGINT)
        self.assertEqual(finish(process)[0], 130)

    def test_one_that_cannot_be_bound_ends_all(self):
        code, out, err = self.run_at("bind", "car1:localization", "car1:echo")
        self.assertEqual(code, 3, out)
        self.assertIn("no_task: ", err)

    def test_hz_has_a_line_for_each(self):
        self.run_ok("update", "car1:notice", "-d", '{"text":"hi"}')
        out = self.run_ok("hz", "car1:**", "-n", "10")
        self.assertRegex(out.splitlines()[-2], r"^car1:localization: [\d.]+ updates/s; ")
        self.assertEqual(out.splitlines()[-1], "car1:notice: no update since the last line; 0 updates, missed 0")
        last = [json.loads(line) for line in self.run_ok("hz", "car1:l*", "-n", "10", "-o", "json").splitlines()][-1]
        self.assertEqual((last["noun"], last["updates"]), ("car1:localization", 10))

    def test_sniff(self):
        items = [json.loads(line) for line in self.run_ok("sniff", "-n", "3").splitlines()]
        self.assertIn("car1:localization", {item["noun"] for item in items})
        self.assertRegex(items[0]["at"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z$")
        lines = self.run_ok("sniff", "car1:loc*", "-n", "2", "-o", "table").splitlines()
        self.assertRegex(lines[1], r'^\d\d:\d\d:\d\d\.\d{3}  car1:localization  #\d+  {"utc":')

    def test_a_node_that_does_not_tell_its_nouns(self):
        def answer(line, send):
            if line.startswith("PULL car1:cles/nouns"):
                send(id_of(line) + '{"error":"no_task","message":"no such"}')
            elif line.startswith("PULL car1:cles "):
                send(id_of(line) + '{"node":"car1","tasks":[{"verb":"BIND","task":"x"},{"verb":"PULL","task":"y"}]}')
            else:
                Feeds.updates(line, send, (1,))

        with ScriptedNode(answer) as node:
            code, out, err = cles("bind", "car1:*", "-n", "1", "--at", node.url)
        self.assertEqual((code, out, err), (0, '{"node":"car1","noun":"x","seq":1,"update":{"n":1}}\n', ""))

    def test_nouns_that_cannot_be_bound_are_left_out(self):
        """If that leaves none, it does not wait for nothing."""

        def answer(line, send):
            if line.startswith("PULL car1:cles/nouns"):
                send(id_of(line) + '{"nouns":["x","y"]}')
            elif line.startswith("BIND "):
                send(id_of(line) + '{"error":"denied","message":"no"}')

        with ScriptedNode(answer) as node:
            code, out, err = cles("bind", "car1:**", "--at", node.url)
        self.assertEqual((code, out), (5, ""), err)
        self.assertRegex(err, r"^cles: car1:[xy]: denied: no\ncles: denied: no\n$")

    def test_a_node_that_denies_its_nouns(self):
        def answer(line, send):
            if line.startswith("PULL car1:cles/nouns"):
                send(id_of(line) + '{"error":"denied","message":"no"}')
            elif line.startswith("PULL car1:cles "):
                send(id_of(line) + '{"node":"car1","tasks":[{"verb":"BIND","task":"x"}]}')
            else:
                Feeds.updates(line, send, (1,))

        with ScriptedNode(answer) as node:
            code, out, err = cles("bind", "car1:*", "-n", "1", "--at", node.url)
        self.assertEqual((code, out, err), (0, '{"node":"car1","noun":"x","seq":1,"update":{"n":1}}\n', ""))

    def test_names_that_are_none_are_left_out(self):
        def answer(line, send):
            if line.startswith("PULL car1:cles/nouns"):
                send(id_of(line) + '{"nouns":["a b","x\\n","x"]}')
            else:
                Feeds.updates(line, send, (1,))

        with ScriptedNode(answer) as node:
            code, out, err = cles("bind", "car1:**", "-n", "1", "--at", node.url)
        self.assertEqual((code, err), (0, ""), out)
        self.assertEqual(json.loads(out)["noun"], "x")


class Later(unittest.TestCase):
    """Publishers that come later, found by their names."""

    def setUp(self):
        self.env = environment(CLES_MULTICAST=f"lo,239.255.25.37:{free_port()}")

    def publish(self, noun):
        process = start("publish", noun, "-d", '{"text":"hi"}', "--rate", "20", env=self.env)
        self.addCleanup(lambda: (process.terminate(), finish(process)))
        read_line(process)

    def test_they_are_waited_for(self):
        for number, arguments in enumerate((("bind", "car1:notice"), ("bind", "all:no*"), ("sniff",)), 1):
            wait = ("--wait",) if arguments[0] == "bind" else ()
            process = start(*arguments, *wait, "-n", "1", "-o", "json", env=self.env)
            if number == 1:
                self.publish("car1:notice")
            code, out, err = finish(process)
            self.assertEqual((code, err), (0, ""), arguments)
            update = json.loads(out)
            self.assertEqual(update.get("update", update), {"text": "hi"})

    def test_a_user_is_told_that_it_waits(self):
        process = start("sniff", env=self.env)
        self.assertEqual(read_line(process, process.stderr), "cles: nothing that matches is published yet; still waiting\n")
        process.send_signal(signal.SIGINT)
        self.assertEqual(finish(process)[0], 130)

    def test_a_noun_that_comes_later(self):
        process = start("bind", "car2:**", "--wait", "-n", "1", env=self.env)
        self.publish("car2:notice/new")
        code, out, err = finish(process)
        self.assertEqual((code, json.loads(out)["noun"], err), (0, "notice/new", ""))


class Hz(NodeTest):
    ARGUMENTS = ("--rate", "100")

    def test_text(self):
        out = self.run_ok("hz", "car1:localization", "-n", "20")
        self.assertRegex(out.splitlines()[-1],
                         r"^[\d.]+ updates/s; interval mean [\d.]+ min [\d.]+ max [\d.]+ stddev [\d.]+ ms over 19; "
                         r"20 updates, missed 0$")

    def test_json(self):
        lines = [json.loads(line) for line in
                 self.run_ok("hz", "car1:localization", "--duration", "1500ms", "-o", "json").splitlines()]
        self.assertEqual(len(lines), 2)  # after a second, and at the end
        last = lines[-1]
        self.assertTrue(50 < last["rate"] < 150, last)
        self.assertLessEqual(last["min_ms"], last["mean_ms"])
        self.assertLessEqual(last["mean_ms"], last["max_ms"])
        self.assertGreaterEqual(last["stddev_ms"], 0)

    def test_window(self):
        out = self.run_ok("hz", "car1:localization", "-n", "20", "-w", "5")
        self.assertIn(" over 5;", out)

    def test_silence(self):
        out = self.run_ok("hz", "car1:notice", "--duration", "100ms")
        self.assertEqual(out, "no update since the last line; 0 updates, missed 0\n")

    def test_interrupt_sums_up(self):
        process = start("hz", "car1:localization", "--at", self.node.url)
        read_line(process)
        process.send_signal(signal.SIGINT)
        code, out, err = finish(process)
        self.assertEqual((code, err), (130, ""))
        self.assertRegex(out, r"updates/s|no update")


class Ping(NodeTest):
    def test_text(self):
        out = self.run_ok("ping", self.node.unix, "-n", "3", "-i", "1ms").splitlines()
        self.assertRegex(out[0], rf"^PING car1 \({self.node.unix}\): PULL self:cles, version \S+$")
        for i, line in enumerate(out[1:4], 1):
            self.assertRegex(line, rf"^answer from car1: seq={i} time=\d+\.\d\d\d ms$")
        self.assertEqual(out[4:7], ["", "--- car1 ping statistics ---", "3 requests, 3 answers, 0% lost"])
        self.assertRegex(out[7], r"^round trip min/avg/max/mdev = [\d.]+/[\d.]+/[\d.]+/[\d.]+ ms$")

    def test_by_name(self):
        code, out, _ = cles("ping", "car1", "--peer", f"car1={self.node.url}", "-n", "1")
        self.assertEqual(code, 0)
        self.assertTrue(out.startswith(f"PING car1 ({self.node.url}): PULL car1:cles"), out)
        code, out, err = self.run_at("ping", "car2", "-n", "1")
        self.assertEqual((code, out), (3, ""), err)

    def test_json(self):
        lines = [json.loads(line) for line in self.run_ok("ping", "-n", "2", "-i", "0", "-o", "json").splitlines()]
        self.assertEqual([line.get("seq") for line in lines], [1, 2, None])
        self.assertEqual((lines[2]["sent"], lines[2]["received"]), (2, 2))
        self.assertLessEqual(lines[2]["min_ms"], lines[2]["max_ms"])

    def test_interrupt_sums_up(self):
        process = start("ping", "-n", "0", "-i", "1min", "--at", self.node.url)
        read_line(process)
        read_line(process)
        process.send_signal(signal.SIGINT)
        code, out, _ = finish(process)
        self.assertEqual(code, 130)
        self.assertIn("1 requests, 1 answers, 0% lost", out)

    def test_answers_that_stay_out(self):
        def answer(line, send):
            if " id=" not in line or line.split(" id=")[1].split()[0] != "2":
                send(id_of(line) + '{"node":"carx"}')

        with ScriptedNode(answer) as node:
            code, out, err = cles("ping", node.url, "-n", "2", "-i", "0", "-t", "100ms")
        self.assertEqual(code, 0)
        self.assertIn("2 requests, 1 answers, 50.0% lost", out)
        self.assertTrue(err.startswith("cles: seq=1 deadline: "), err)


class Info(NodeTest):
    def test_table(self):
        out = self.run_ok("info", "-o", "table")
        self.assertRegex(out, r"(?m)^node       car1$")
        self.assertRegex(out, r"(?m)^version    \S+$")
        self.assertRegex(out, r"(?m)^uptime     \d+ (ms|s)")
        self.assertIn(f"endpoints  {self.node.url}\n           {self.node.unix}\n", out)
        self.assertRegex(out, r"(?m)^VERB +TASK +DESCRIPTION$")
        self.assertRegex(out, r"(?m)^DELEGATE +sleep/<ms> +Waits that many milliseconds")

    def test_json_when_piped(self):
        about = self.run_json("info")
        self.assertEqual((about["node"], about["protocol"]), ("car1", 1))

    def test_by_name_and_url(self):
        self.assertEqual(json.loads(cles("info", self.node.url)[1])["node"], "car1")
        self.assertEqual(json.loads(cles("info", "car1", "--at", self.node.unix)[1])["node"], "car1")
        self.assertEqual(self.run_at("info", "car9")[0], 3)


if __name__ == "__main__":
    unittest.main()
