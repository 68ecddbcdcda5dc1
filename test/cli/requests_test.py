#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles pull`, `push`, `delegate`, `update`: replies, output formats, exit codes, and what is sent."""

import json
import signal
import socket
import subprocess
import tempfile
import unittest

from support import CLES, NodeTest, ScriptedNode, cles, environment, finish, id_of, read_line, start, wait_until


class Answers(NodeTest):
    def test_pull(self):
        packet = self.run_json("pull", "car1:localization")
        self.assertEqual(list(packet), ["utc", "lat", "lon", "velocity", "acceleration"])

    def test_pull_by_unix_socket_and_by_self(self):
        code, out, _ = cles("pull", "self:echo/1/b%20c", "--at", self.node.unix)
        self.assertEqual((code, out), (0, '{"parameters":["1","b c"]}\n'))

    def test_peers_are_named(self):
        code, out, _ = cles("pull", "car1:echo", "--peer", "car2=tcp://127.0.0.1:1", "--peer", f"car1={self.node.url}")
        self.assertEqual((code, out), (0, '{"parameters":[]}\n'))
        code, out, err = cles("pull", "car3:echo", "--peer", f"car1={self.node.url}")
        self.assertEqual((code, out), (3, ""))
        self.assertEqual(err, "cles: no_target: there is no --peer 'car3', and no --at\n")
        code, out, _ = cles("pull", "self:echo", "--peer", "car2=tcp://127.0.0.1:1", "--at", self.node.url)
        self.assertEqual((code, out), (0, '{"parameters":[]}\n'))

    def test_the_environment_says_where(self):
        code, out, _ = cles("pull", "car1:echo", env=environment(CLES_AT=self.node.url))
        self.assertEqual((code, out), (0, '{"parameters":[]}\n'))

    def test_push(self):
        self.assertEqual(self.run_ok("push", "car1:echo", "-d", '{"speed": 27.80}'), '{"speed":27.80}\n')
        self.assertEqual(self.run_ok("push", "car1:echo"), "{}\n")
        self.assertEqual(self.run_ok("push", "car1:echo", "-d", "[1, 2]"), "[1,2]\n")

    def test_body_from_stdin_and_file(self):
        pretty = '{\n  "a": [\n    1,\n    "x\\ny"\n  ]\n}\n'
        self.assertEqual(self.run_ok("delegate", "car1:echo", "-d", "-", stdin=pretty), '{"a":[1,"x\\ny"]}\n')
        with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
            file.write(pretty)
            file.flush()
            self.assertEqual(self.run_ok("push", "car1:echo", "-d", "@" + file.name), '{"a":[1,"x\\ny"]}\n')

    def test_large_body(self):
        body = json.dumps({"a": "x" * 500_000})
        self.assertEqual(json.loads(self.run_ok("push", "car1:echo", "-d", "-", stdin=body)), json.loads(body))
        code, out, err = self.run_at("push", "car1:echo", "-d", "-", stdin=json.dumps({"a": "x" * 1_100_000}))
        self.assertEqual((code, out), (5, ""))
        self.assertTrue(err.startswith("cles: too_large: "), err)

    def test_delegate(self):
        self.assertEqual(self.run_ok("delegate", "car1:sleep/20"), '{"slept_ms":20}\n')

    def test_delegate_shows_progress_when_asked(self):
        code, out, err = self.run_at("delegate", "car1:sleep/50", "--progress")
        self.assertEqual((code, out), (0, '{"slept_ms":50}\n'))
        self.assertEqual(err.splitlines(), [f"cles: progress {10 * i}%" for i in range(1, 10)])

    def test_update(self):
        s, lines = self.node.connect()
        with s, lines:
            s.sendall(b"BIND car1:notice\n")
            lines.readline()
            self.assertEqual(self.run_ok("update", "car1:notice", "-d", '{"text": "hi"}'), "{}\n")
            self.assertTrue(lines.readline().endswith(' {"text":"hi"}\n'))

    def test_count(self):
        out = self.run_ok("pull", "car1:echo/x", "-n", "3", "-i", "0")
        self.assertEqual(out, '{"parameters":["x"]}\n' * 3)
        out = self.run_ok("push", "car1:echo", "-d", '{"a":1}', "--count", "2", "--interval", "10ms")
        self.assertEqual(out, '{"a":1}\n' * 2)

    def test_each_line_is_a_body(self):
        out = self.run_ok("push", "car1:echo", "--lines", stdin='{"a": 1}\n\n [2, 3]\n{"last":true}')
        self.assertEqual(out, '{"a":1}\n[2,3]\n{"last":true}\n')
        self.assertEqual(self.run_ok("delegate", "car1:echo", "--lines", stdin=""), "")
        s, lines = self.node.connect()
        with s, lines:
            s.sendall(b"BIND car1:notice\n")
            lines.readline()
            out = self.run_ok("update", "car1:notice", "--lines", stdin='{"n":1}\n{"n":2}\n')
            self.assertEqual(out, "{}\n{}\n")
            self.assertEqual([lines.readline().split(" ")[-1] for _ in range(2)], ['{"n":1}\n', '{"n":2}\n'])

    def test_a_line_is_answered_before_the_next_is_read(self):
        process = subprocess.Popen([CLES, "push", "car1:echo", "--lines", "--at", self.node.url], text=True,
                                   stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   env=environment())
        for n in range(3):
            process.stdin.write('{"n":%d}\n' % n)
            process.stdin.flush()
            self.assertEqual(read_line(process), '{"n":%d}\n' % n)
        code, out, err = finish(process)
        self.assertEqual((code, out, err), (0, "", ""))

    def test_a_line_that_fails_has_an_answer_too(self):
        code, out, err = self.run_at("push", "car1:echo", "--lines", stdin='{"a":1}\n{"a":\n7\n{"a":2}\n')
        answers = [json.loads(line) for line in out.splitlines()]
        self.assertEqual((code, answers[0], answers[3]), (2, {"a": 1}, {"a": 2}))
        self.assertEqual([answer["error"] for answer in answers[1:3]], ["bad_request"] * 2)
        self.assertTrue(err.startswith("cles: line 2 of stdin: the body is not valid JSON: "), err)
        code, out, err = self.run_at("delegate", "car1:fail", "--lines", stdin="{}\n{}\n")
        self.assertEqual((code, out), (5, '{"error":"failed","message":"car1: this task always fails"}\n' * 2))
        self.assertEqual(err, "cles: failed: line 1 of stdin: car1: this task always fails\n")

    def test_a_node_that_is_gone_ends_the_lines(self):
        with socket.create_server(("127.0.0.1", 0)) as gone:
            url = f"tcp://127.0.0.1:{gone.getsockname()[1]}"
        code, out, err = cles("push", "car1:echo", "--lines", "--no-check", "--at", url, stdin="{}\n{}\n")
        self.assertEqual((code, out), (1, ""), err)
        self.assertIn("refused", err)

    def test_tables(self):
        body = '{"a":1,"b":{"c":"x\\u001b[31m","d":[1,"two"]},"list":[{"n":1,"s":"one"},{"n":10,"t":{"u":null}}],"e":{}}'
        out = self.run_ok("push", "car1:echo", "-d", body, "-o", "table")
        self.assertEqual(out, "a    1\n"
                              "b.c  x\\u001b[31m\n"
                              "b.d  1, two\n"
                              "e    {}\n"
                              "\n"
                              "list:\n"
                              " n  s    t.u\n"
                              " 1  one\n"
                              "10       null\n")
        out = self.run_ok("push", "car1:echo", "-d", '[{"a":1},{"a":2}]', "-o", "table")
        self.assertEqual(out, "a\n1\n2\n")
        self.assertEqual(self.run_ok("push", "car1:echo", "-d", '[1,"b",[2]]', "-o", "table"), "1\nb\n2\n")
        self.assertEqual(self.run_ok("push", "car1:echo", "-o", "table"), "{}\n")
        out = self.run_ok("push", "car1:echo", "-d", '{"key":"abc","n":7}', "-o", "table", "-n", "2", "-i", "0")
        self.assertEqual(out, "key  n\nabc  7\nabc  7\n")
        out = self.run_ok("push", "car1:echo", "-d", '{"a":7,"bc":1234.5,"d":-3}', "-o", "table")
        self.assertEqual(out, "a        7\nbc  1234.5\nd       -3\n")  # only numbers

    def test_the_wire_is_shown(self):
        code, out, err = self.run_at("pull", "car1:echo/x", "-vv")
        self.assertEqual((code, out), (0, '{"parameters":["x"]}\n'))
        self.assertRegex(err, rf"debug   > {self.node.url} PULL car1:echo/x id=1( .*)?\n")
        self.assertRegex(err, rf'debug   < {self.node.url} id=1 {{"parameters":\["x"\]}}\n')
        code, out, err = cles("push", "car1:echo", "-d", '{"a":"%s"}' % ("x" * 5000), "-vv", "--at", self.node.unix)
        self.assertEqual(code, 0)
        self.assertRegex(err, r"> unix://\S+ PUSH car1:echo .*x\.\.\. and \d+ more bytes\n")
        self.assertNotIn("> ", self.run_at("pull", "car1:echo/x", "-v")[2])


class Failures(NodeTest):
    def test_the_task_that_was_probably_meant(self):
        for verb, task, says in (("pull", "localisation", "did you mean 'car1:localization' (PULL, BIND)?"),
                                 ("bind", "notic", "did you mean 'car1:notice' (BIND, UPDATE)?")):
            code, out, err = self.run_at(verb, f"car1:{task}")
            self.assertEqual((code, out), (3, ""))
            self.assertIn("cles: no_task: ", err)
            self.assertIn(f"\ncles: {says}\n", err)
        self.assertEqual(self.run_at("pull", "car1:speed")[2].count("\n"), 1)

    def test_the_node_that_was_probably_meant(self):
        code, _, err = cles("pull", "cra1:echo", "--peer", f"car1={self.node.url}", "--at", self.node.url)
        self.assertEqual(code, 3)
        self.assertIn("did you mean 'car1'?", err)

    def check(self, arguments, code, start_of_error):
        got, out, err = self.run_at(*arguments)
        self.assertEqual((got, out), (code, ""), err)
        self.assertTrue(err.startswith("cles: " + start_of_error), err)
        self.assertEqual(err.count("\n"), 1, err)

    def test_no_task(self):
        self.check(("pull", "car1:speed"), 3, "no_task: car1 has no PULL 'speed'")
        self.check(("push", "car1:localization"), 3, "no_task: ")
        self.check(("bind", "car1:echo"), 3, "no_task: ")

    def test_no_target(self):
        code, out, err = self.run_at("pull", "car2:localization")
        self.assertEqual((code, out), (3, ""), err)
        self.assertRegex(err, r"^cles: no_target: .*\ncles: cles ls --at URL lists .*\n$")

    def test_failed(self):
        self.check(("delegate", "car1:fail"), 5, "failed: car1: this task always fails")

    def test_bad_request(self):
        self.check(("delegate", "car1:sleep/x"), 5, "bad_request: ")

    def test_deadline(self):
        self.check(("delegate", "car1:sleep/20000", "-t", "100ms"), 4, "deadline: ")
        self.check(("delegate", "car1:sleep/20000", "-t", "0.1"), 4, "deadline: ")

    def test_connection_refused(self):
        with socket.create_server(("127.0.0.1", 0)) as gone:
            url = f"tcp://127.0.0.1:{gone.getsockname()[1]}"
        for command in ("pull", "push", "bind", "hz", "ping", "info"):
            noun = () if command in ("ping", "info") else ("car1:localization",)
            code, out, err = cles(command, *noun, "--at", url)
            self.assertEqual((code, out), (1, ""), (command, err))
            self.assertTrue(err.startswith("cles: "), err)
            self.assertIn("refused", err)
            self.assertIn(url, err)

    def test_no_such_socket(self):
        code, out, err = cles("pull", "car1:localization", "--at", "unix:///nowhere/car1.sock")
        self.assertEqual((code, out), (1, ""), err)
        self.assertIn("No such file", err)

    def test_output_that_cannot_be_written(self):
        with open("/dev/full", "w", encoding="utf-8") as full:
            process = start("pull", "car1:localization", "--at", self.node.url, stdout=full)
            code, _, err = finish(process)
        self.assertEqual((code, err), (1, "cles: cannot write the output: No space left on device\n"))


class Wire(unittest.TestCase):
    """What the command sends, and how it treats the replies of other implementations."""

    def ask(self, answer, *arguments):
        with ScriptedNode(lambda line, send: send(id_of(line) + answer)) as node:
            return cles(*arguments, "--at", node.url), node

    def test_sends_one_plain_line(self):
        (code, _, err), node = self.ask("{}", "push", "car1:echo/x", "-d", ' {"a" : 1.50} ', "-t", "2s",
                                          "--no-check")
        self.assertEqual((code, err), (0, ""))
        self.assertRegex(node.lines[0], r'^PUSH car1:echo/x id=\d+ deadline=(19\d\d|2000) \{"a":1\.50\}$')
        self.assertEqual(len(node.lines), 1)

    TYPES = ('{"PUSH":{"body":{"$ref":"#/$defs/place","$defs":{"place":{"type":"object","properties":{"lat":'
             '{"description":"latitude","unit":"deg","type":["number","null"],"minimum":-90,"maximum":90},'
             '"speed":{"default":3,"type":"integer"}},"required":["lat"]}}}}}')

    def typed(self, *arguments):
        """The command at a node that tells the types of one task, and the lines that it has sent."""
        def answer(line, send):
            send(id_of(line) + (self.TYPES if ":cles/types/target " in line else '{"ok":true}'))

        with ScriptedNode(answer) as node:
            return cles(*arguments, "--at", node.url), node.lines

    def test_a_body_that_does_not_fit_is_not_sent(self):
        for body, why in (('{"lat":"x"}', "lat: expected a number or null, got a string"),
                          ('{"lat":91}', "lat: outside of its range, -90 to 90"), ("{}", "lat: is missing")):
            (code, out, err), lines = self.typed("push", "car1:target", "-d", body)
            self.assertEqual((code, out), (2, ""))
            self.assertTrue(err.startswith(f"cles: the body does not fit car1:target: {why} ("), err)
            self.assertEqual([line.split(" ")[0] for line in lines], ["PULL"])

    def test_a_body_that_fits_is_sent(self):
        (code, out, err), lines = self.typed("push", "car1:target", "-d", '{"lat":1}')
        self.assertEqual((code, out, err), (0, '{"ok":true}\n', ""))
        self.assertRegex(lines[1], r'^PUSH car1:target id=\d+ .*\{"lat":1\}$')
        (code, _, err), lines = self.typed("push", "car1:target", "-d", '{"lat":"x"}', "--no-check")
        self.assertEqual((code, err, len(lines)), (0, "", 1))

    def test_a_node_that_tells_no_types_is_sent_anything(self):
        for answer in ("{}", "[]", '{"error":"no_task","message":"car1 has no PULL"}', '{"PUSH":{"body":{"pattern":"x"}}}'):
            (_, _, _), node = self.ask(answer, "push", "car1:target", "-d", "[1]")
            self.assertTrue(any(line.startswith("PUSH car1:target ") for line in node.lines), node.lines)

    def test_the_types_of_a_task(self):
        (code, out, err), lines = self.typed("info", "car1:target", "-o", "table")
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(lines[0].split(" ")[1], "car1:cles/types/target")
        shown = [line.split() for line in out.splitlines()]
        self.assertEqual(shown[0], ["PUSH", "body", "place"])
        self.assertEqual(shown[2], ["lat", "number", "deg", "-90", "to", "90", "latitude"])
        self.assertEqual(shown[3][:3], ["speed", "integer", "3"])
        self.assertEqual(shown[4], ["example", '{"lat":0,"speed":3}'])
        (code, out, _), _ = self.typed("info", "car1:target", "-o", "json")
        self.assertEqual((code, json.loads(out)), (0, json.loads(self.TYPES)))

    def test_forms_of_output(self):
        answer = '{ "a":1.50,  "b":[1, 2] }'
        expected = {"raw": answer + "\n", "json": '{"a":1.50,"b":[1,2]}\n', "table": "a  1.50\nb  1, 2\n"}
        for form, text in expected.items():
            (code, out, _), _ = self.ask(answer, "pull", "car1:x", "-o", form)
            self.assertEqual((code, out), (0, text))

    def test_json_is_the_default_of_a_pipe(self):
        (code, out, _), _ = self.ask('{ "a":1}', "pull", "car1:x")
        self.assertEqual((code, out), (0, '{"a":1}\n'))

    def test_exit_codes_of_errors(self):
        codes = {"bad_request": 5, "denied": 5, "no_target": 3, "no_task": 3, "too_large": 5, "cancelled": 5, "failed": 5,
                 "unavailable": 5, "busy": 6, "deadline": 4, "from_the_future": 5}
        for name, expected in codes.items():
            (code, out, err), _ = self.ask(f'{{"error":"{name}","message":"why \\u001b[2J"}}', "pull", "car1:x")
            self.assertEqual((code, out), (expected, ""), name)
            shown = name if name != "from_the_future" else "failed"
            self.assertTrue(err.startswith(f"cles: {shown}: why "), err)
            self.assertNotIn("\x1b", err)

    def test_what_controls_a_terminal_is_not_shown(self):
        controls = [*range(0x7f, 0xa0), 0x61c, 0x200e, 0x200f, *range(0x202a, 0x202f), *range(0x2066, 0x206a)]
        text = "".join(f"{chr(each)}x" for each in controls)
        escaped = "".join(f"\\u{each:04x}x" for each in controls)
        for form in ("json", "raw", "table"):
            (code, out, err), _ = self.ask(f'{{"{text}":"{text}"}}', "pull", "car1:x", "-o", form)
            self.assertEqual((code, err), (0, ""), form)
            shown = f"{escaped}  {escaped}" if form == "table" else f'{{"{escaped}":"{escaped}"}}'
            self.assertEqual(out, shown + "\n", form)
        (code, out, err), _ = self.ask(f'{{"error":"denied","message":"{text}"}}', "pull", "car1:x")
        self.assertEqual((code, out, err), (5, "", f"cles: denied: {escaped}\n"))
        (code, _, err), _ = self.ask(f'{{"a":"{text}"}}', "pull", "car1:x", "-vv")
        self.assertEqual(code, 0)
        self.assertIn(f'{{"a":"{escaped}"}}', err)

    def test_a_link_lost_after_sending(self):
        with ScriptedNode(lambda line, send: "close") as node:
            code, out, err = cles("pull", "car1:x", "--at", node.url)
        self.assertEqual((code, out), (5, ""), err)
        self.assertTrue(err.startswith("cles: unavailable: "), err)

    def test_a_node_that_has_reached_its_limit_of_links(self):
        def refuse(_, send):
            send('{"error":"busy","message":"car1 has reached its limit of links","retry_ms":1000}')
            return "close"

        with ScriptedNode(refuse) as node:
            code, out, err = cles("pull", "car1:x", "--at", node.url)
        self.assertEqual((code, out, err), (6, "", "cles: busy: car1 has reached its limit of links\n"))

    def test_an_answer_that_never_comes(self):
        with ScriptedNode(lambda line, send: None) as node:
            code, out, err = cles("pull", "car1:x", "--at", node.url, "-t", "100ms")
        self.assertEqual((code, out), (4, ""), err)

    def test_interrupt_withdraws_the_request(self):
        with ScriptedNode(lambda line, send: None) as node:
            process = start("delegate", "car1:x", "--at", node.url)
            wait_until(lambda: node.lines, "the request")
            process.send_signal(signal.SIGINT)
            code, out, err = finish(process)
            wait_until(node.closed.is_set, "the end of the link")
        self.assertEqual((code, out, err), (130, "", ""))
        number = id_of(node.lines[0]).strip().removeprefix("id=")
        self.assertTrue(node.lines[1].startswith(f"PUSH self:cles/cancel/{number}"), node.lines)

    def test_interrupt_while_waiting_for_the_next(self):
        with ScriptedNode(lambda line, send: send(id_of(line) + "{}")) as node:
            process = start("pull", "car1:x", "-n", "0", "-i", "1min", "--at", node.url)
            self.assertEqual(read_line(process), "{}\n")
            process.send_signal(signal.SIGINT)
            code, _, err = finish(process)
        self.assertEqual((code, err), (130, ""))

    def test_termination(self):
        with ScriptedNode(lambda line, send: None) as node:
            process = start("pull", "car1:x", "--at", node.url)
            wait_until(lambda: node.lines, "the request")
            process.send_signal(signal.SIGTERM)
            code, _, err = finish(process)
        self.assertEqual((code, err), (143, ""))

    def test_progress_is_only_asked_for_where_it_shows(self):
        (_, _, _), node = self.ask("{}", "delegate", "car1:x")
        self.assertNotIn("progress", node.lines[0])
        (_, _, _), node = self.ask("{}", "delegate", "car1:x", "--progress")
        self.assertIn(" progress=yes", node.lines[0])

    def test_urgent_where_it_is_said(self):
        for verb in ("pull", "push", "delegate"):
            (code, _, _), node = self.ask("{}", verb, "car1:x", "--urgent")
            self.assertEqual(code, 0)
            self.assertIn(" urgent=yes", node.lines[0])
        (_, _, _), node = self.ask("{}", "pull", "car1:x")
        self.assertNotIn("urgent", node.lines[0])

    def test_progress_with_details(self):
        def answer(line, send):
            send(id_of(line) + 'progress=0.25 {"step":"one"}')
            send(id_of(line) + '{"ok":true}')

        with ScriptedNode(answer) as node:
            code, out, err = cles("delegate", "car1:x", "--progress", "--at", node.url)
        self.assertEqual((code, out, err), (0, '{"ok":true}\n', 'cles: progress 25% {"step":"one"}\n'))


if __name__ == "__main__":
    unittest.main()
