#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Lines, nouns, JSON and timers: what the recorded conversations do not cover."""

import unittest
from types import SimpleNamespace

from cles import grammar, jsontext
from cles.errors import Error
from cles.grammar import LineBuffer, Malformed, parse_noun, parse_reply, parse_request, salvage
from cles.limits import Budget
from cles.liveness import Liveness
from cles.timers import MS, Timers


class Lines(unittest.TestCase):
    def test_bytes_become_lines_however_they_arrive(self):
        text = "PULL a:b\r\n\nPUSH a:b {\"x\":\"ä\"}\nrest".encode()
        for size in (1, 2, 3, 7, len(text)):
            lines = LineBuffer(100)
            got = [line for at in range(0, len(text), size) for line in lines.feed(text[at:at + size])]
            self.assertEqual((got, lines.unfinished()), (["PULL a:b\r", "", 'PUSH a:b {"x":"ä"}'], "rest"))

    def test_the_limit(self):
        for text, expected in ((b"x" * 10 + b"\n", None), (b"x" * 10 + b"\r\n", None), (b"x" * 11 + b"\n", "x" * 10),
                               (b"x" * 11, "x" * 10), (b"x" * 10, None)):
            lines = LineBuffer(10)
            lines.feed(text)
            self.assertEqual(lines.overlong, expected, text)
        lines = LineBuffer(10)
        self.assertEqual(lines.feed(b"a\n" + b"x" * 20 + b"\nb\n"), ["a"])
        self.assertEqual(lines.feed(b"c\n"), [])

    def test_bytes_that_are_not_utf8_are_not_json(self):
        line = LineBuffer(100).feed(b'PUSH a:b {"x":"\xff"}\n')[0]
        with self.assertRaises(jsontext.Invalid):
            jsontext.read(parse_request(line).body)


class Requests(unittest.TestCase):
    def test_what_is_written_is_read(self):
        line = grammar.request_line("DELEGATE", "a:b/c", '{"x":1}', id=7, deadline=100, progress=True, urgent=True, hops=3,
                                    trace=grammar.parse_trace("00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01"))
        r = parse_request(line)
        self.assertEqual((r.verb, r.noun.parameters, r.id, r.deadline, r.progress, r.urgent, r.hops, r.body),
                         ("DELEGATE", ("c",), 7, 100, True, True, 3, '{"x":1}'))
        self.assertEqual(str(r.trace), "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01")
        bound = parse_request(grammar.request_line("BIND", "a:b", every=5, keep=9, lease=100_000, mark=True))
        self.assertEqual((bound.every, bound.keep, bound.lease, bound.mark), (5, 9, 60_000, True))

    def test_verbs_are_ascii(self):
        self.assertEqual(parse_request("pUsH a:b").verb, "PUSH")
        for line in ("puſh a:b", "PUSHa:b", "PUSH"):
            with self.assertRaises(Malformed):
                parse_request(line)

    def test_parameters(self):
        self.assertEqual(parse_noun("a:b/%C3%A4/%2F").path, "b/%C3%A4/%2F")
        self.assertEqual(parse_noun("a:b/%61%7e").path, "b/a~")
        self.assertEqual(grammar.encode_parameter("front left/ä~+"), "front%20left%2F%C3%A4~+")
        for wrong in ("", "\n", "\x7f", "\x85"):
            with self.assertRaises(Malformed):
                grammar.encode_parameter(wrong)
        self.assertEqual(len(parse_noun("a:b/" + "x" * 5000).path), 5002)

    def test_salvage(self):
        for line, expected in (("PULL a id=3", (3, True)), ("PULL a id=3 id=4", (0, True)), ("PULL a id=x id=3", (3, True)),
                               ('PUSH a reply=no {"id=3":', (0, False)), ("UPDATE a seq=1 epoch=5f3a09c1", (0, False)),
                               ("UPDATE a seq=1", (0, True)), ('X {"a": "id=3"}', (0, True))):
            found = salvage(line)
            self.assertEqual((found.id, found.wants_reply), expected, line)


class Replies(unittest.TestCase):
    def test_heads(self):
        reply = parse_reply('id=7 seq=2 epoch=5f3a09c1 {"a":1}')
        self.assertEqual((reply.id, reply.seq, reply.epoch, reply.body), (7, 2, "5f3a09c1", '{"a":1}'))
        self.assertEqual(parse_reply("id=7 seq=2 {}").seq, 0)
        self.assertEqual(parse_reply("id=7 progress=1e-1 {}").progress, 0.1)
        for wrong in ("id=7", "id=7 x", "id=0 {}", "id=07 {}", "id=7 progress=1.1 {}", "id=7 progress=.5 {}",
                      "id=7 progress=nan {}", "id=7 id=7 {}", "{}"):
            self.assertIsNone(parse_reply(wrong), wrong)


class Json(unittest.TestCase):
    def test_only_json_is_read(self):
        for text, value in (("{}", {}), (' [1, -0.5e3, "\\u00e4"] ', [1, -500.0, "ä"]), ('"\\ud83d\\ude00"', "😀"),
                            ("[" * 32 + "]" * 32, None), ('{"a":"[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[["}', None)):
            read = jsontext.read(text)
            if value is not None:
                self.assertEqual(read, value)
        for text in ("", "{", "{'a':1}", "[01]", "[1,]", "NaN", "[Infinity]", "[-Infinity]", '"\\ud800"', '"\t"', "{} {}", "[1] x",
                     "[" * 33 + "]" * 33, '{"a":1,}', "tru", "\ufeff{}"):
            with self.assertRaises(jsontext.Invalid, msg=text):
                jsontext.read(text)

    def test_long_numbers(self):
        self.assertEqual(jsontext.read("[1e999]"), [float("inf")])
        self.assertEqual(jsontext.read("[" + "1" * 5000 + "]"), [float("inf")])
        self.assertEqual(jsontext.read('["\\u0041",1e999]')[0], "A")

    def test_what_is_written(self):
        self.assertEqual(jsontext.write({"a": [1.5, float("nan"), "ä\n"]}), '{"a":[1.5,null,"ä\\n"]}')
        cycle = []
        cycle.append(cycle)
        deep = 1
        for _ in range(36):
            deep = [deep]
        for wrong in (cycle, deep, "\ud800", {1, 2}, b"x", {(1,): 2}):
            with self.assertRaises(jsontext.Invalid):
                jsontext.write(wrong)


class State(unittest.TestCase):
    def test_timers_are_called_in_order_and_cancelled_ones_are_forgotten(self):
        timers, called = Timers(), []
        for due in (3, 1, 2, 1):
            timers.at(due, lambda now, due=due: called.append((due, now)))
        timers.at(2, lambda now: called.append("never")).cancel()
        timers.run(0)
        timers.run(2)
        self.assertEqual(called, [(1, 2), (1, 2), (2, 2)])
        self.assertEqual(timers.next_due(), 3)
        for _ in range(10_000):
            timers.at(10, called.append).cancel()
        self.assertLess(len(timers._heap), 200)

    def test_a_node_that_is_silent_is_asked_and_then_lost(self):
        told = []
        owner = SimpleNamespace(awaits_peer=lambda: True, may_be_asked=lambda: True, ask_peer=lambda: told.append("asked"),
                                on_hung=lambda: told.append("hung"))
        timers = Timers()
        liveness = Liveness(timers, owner, 0.9)

        def until(ms):
            while (due := timers.next_due()) is not None and due <= ms * MS:
                timers.run(due)

        liveness.watch(0)
        until(299)
        self.assertEqual(told, [])
        until(300)
        self.assertEqual(told, ["asked"])
        liveness.on_input(400 * MS)
        until(699)
        self.assertEqual(told, ["asked"])
        until(900)
        self.assertEqual(told, ["asked", "asked"])
        until(1500)
        self.assertEqual(told, ["asked", "asked", "hung"])
        self.assertIsNone(timers.next_due())
        # What was suspended has not noticed the silence.
        liveness = Liveness(timers, owner, 0.9)
        told.clear()
        liveness.watch(2000 * MS)
        timers.run(60_000 * MS)
        self.assertEqual(told, [])
        until(60_300)
        self.assertEqual(told, ["asked"])

    def test_a_link_holds_as_much_as_remains_free_for_others(self):
        budget = Budget(1000)
        one, other = budget.account(), budget.account()
        self.assertTrue(one.try_hold(500))
        self.assertFalse(one.try_hold(1))
        self.assertTrue(other.try_hold(250))
        self.assertFalse(other.try_hold(1))
        one.release(500)
        self.assertTrue(other.try_hold(1))
        self.assertEqual((budget.used, budget.refused), (251, 2))

    def test_a_code_that_is_not_known_is_a_failure(self):
        self.assertEqual(Error("quarantined").code, "failed")


if __name__ == "__main__":
    unittest.main()
