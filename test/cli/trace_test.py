#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles trace`: the tree of a request."""

import json
import re
import unittest
from pathlib import Path

from support import NodeTest, ScriptedNode, cles, id_of


def span(name, parent, kind, **more):
    made = {"span": name, "parent": parent, "kind": kind, "verb": "DELEGATE", "target": "any", "task": "plan",
            "start_us": 0, "total_us": 1000.0, "outcome": "ok"}
    if kind == "received":
        made |= {"queue_us": 0, "run_us": 0}
    made.update(more)
    return {key: value for key, value in made.items() if value is not None}


class Story:
    """The nodes of a fleet, played by the one that is asked: it answers for them all."""

    def __init__(self, spans, reply='{"value":1}'):
        self.spans, self.reply = spans, reply
        self.root = self.traced = None

    def __call__(self, line, send):
        asked = re.match(r"PULL (\w+):cles/trace/(\w{32}) ", line)
        if asked and self.root is None:
            send(id_of(line) + '{"node":"sat1","spans":[]}')
        elif asked:
            name = "sat1" if asked[1] == "self" else asked[1]
            found = self.spans.get(name)
            if found is None:
                send(id_of(line) + f'{{"error":"denied","message":"{name} does not allow it"}}')
            else:
                send(id_of(line) + json.dumps({"node": name, "spans": [
                    {**each, "parent": self.root if each["parent"] == "root" else each["parent"]} for each in found]}))
        else:
            self.root, self.traced = re.search(r" trace=00-\w{32}-(\w{16})-01", line)[1], line
            send(id_of(line) + self.reply)

    def run(self, *arguments):
        with ScriptedNode(self) as node:
            return cles("trace", *arguments, "--at", node.url)


# Node sat2 is busy; sat3 gives the job to sat4, and asks sat5 for something, which says nothing about it.
FLEET = {
    "sat1": [span("a1", "root", "received", total_us=31000.0),
             span("a3", "a1", "sent", target="sat3", start_us=1200.0, total_us=29000.0),
             span("a2", "a1", "sent", target="sat2", start_us=100.0, total_us=1000.0, outcome="busy")],
    "sat2": [span("b1", "a2", "received", total_us=400.0, outcome="busy")],
    "sat3": [span("c1", "a3", "received", total_us=28500.25, queue_us=9000.0),
             span("c2", "c1", "sent", target="sat4", start_us=9000.0, total_us=19000.0),
             span("c3", "c1", "sent", verb="PULL", task="map", target="sat5", next="sat6", start_us=10.0,
                  total_us=None, outcome=None)],
    "sat4": [span("d1", "c2", "received", total_us=18000.0, queue_us=20.0, run_us=17500.0)],
    "sat6": [],
}

TABLE = """\
HOP                            TOTAL MS  LINK MS  QUEUE MS  RUN MS  OUTCOME
cles DELEGATE any:plan         #         -        -         -       ok
└─ sat1 DELEGATE plan            31.000  #           0.000   0.000  ok
   ├─ sat2 DELEGATE plan          0.400    0.600     0.000   0.000  busy
   └─ sat3 DELEGATE plan         28.500    0.500     9.000   0.000  ok
      ├─ sat6 PULL map                -        -         -       -  not ended
      └─ sat4 DELEGATE plan      18.000    1.000     0.020  17.500  ok
"""


def words_of(table):
    """Without the distances, and the times that depend on this run."""
    return [[word for word in line.split()] for line in table.splitlines()]


class Tree(unittest.TestCase):
    def test_layout(self):
        story = Story(FLEET)
        code, out, err = story.run("delegate", "any:plan", "-d", '{"area":7}')
        self.assertEqual(code, 0, err)
        self.assertEqual(err, "cles: no spans of sat5: denied: sat5 does not allow it\n")
        first, _, table = out.partition("\n")
        self.assertRegex(first, r"^trace \w{32}$")
        self.assertIn(f" trace=00-{first.split()[1]}-", story.traced)
        self.assertIn('{"area":7}', story.traced)
        for line, expected in zip(words_of(table), words_of(TABLE), strict=True):
            self.assertEqual(["#" if e == "#" else w for w, e in zip(line, expected, strict=True)], expected)
        lines = table.splitlines()
        ends = {len(re.match(r".*?\S+ (DELEGATE|PULL) \S+ +\S+", line)[0]) for line in lines[1:]}
        self.assertEqual(len(ends), 1, table)  # numbers are aligned at the right

    def test_json(self):
        code, out, _ = Story(FLEET).run("delegate", "any:plan", "-o", "json")
        self.assertEqual(code, 0)
        found = json.loads(out)
        self.assertRegex(found["trace"], r"^[0-9a-f]{32}$")
        self.assertEqual(found["outcome"], "ok")
        (first,) = found["request"]["hops"]
        self.assertEqual([hop["node"] for hop in first["hops"]], ["sat2", "sat3"])
        self.assertEqual(first["hops"][1], {
            "node": "sat3", "request": "DELEGATE plan", "total_us": 28500.25, "link_us": 499.75, "queue_us": 9000,
            "run_us": 0, "outcome": "ok", "hops": [
                {"node": "sat6", "request": "PULL map", "hops": []},
                {"node": "sat4", "request": "DELEGATE plan", "total_us": 18000, "link_us": 1000, "queue_us": 20,
                 "run_us": 17500, "outcome": "ok", "hops": []}]})

    def test_spans_whose_sender_is_silent(self):
        code, out, err = Story({"sat1": [span("a1", "root", "received"), span("a2", "a1", "sent", target="sat3", next="sat2")],
                                "sat3": [span("c1", "b2", "received", total_us=7.0)]}).run("delegate", "any:plan")
        self.assertEqual(code, 0)
        self.assertIn("no spans of sat2", err)
        self.assertEqual([line.split()[:3] for line in out.splitlines()[2:]],
                         [["cles", "DELEGATE", "any:plan"], ["├─", "sat1", "DELEGATE"], ["│", "└─", "sat2"],
                          ["└─", "sat3", "DELEGATE"]])

    def test_a_node_that_lies_does_not_keep_it_busy(self):
        loop = {"sat1": [span("a1", "root", "received"), span("a2", "a1", "sent", target="sat1"),
                         span("a1", "a2", "received")]}
        code, out, _ = Story(loop).run("delegate", "any:plan")
        self.assertEqual(code, 0)
        self.assertLess(len(out.splitlines()), 10)

    def test_failures(self):
        failing = Story(FLEET, '{"error":"busy","message":"sat3: later","retry_ms":10}')
        code, out, err = failing.run("delegate", "any:plan")
        self.assertEqual(code, 6)
        self.assertIn("busy: sat3: later", err)
        self.assertIn("└─ sat1", out)

    def test_a_node_without_spans(self):
        def answer(line, send):
            if ":cles/trace/" in line:
                send(id_of(line) + '{"error":"no_task","message":"old has no PULL"}')
            else:
                send(id_of(line) + '{"v":1}')

        with ScriptedNode(answer) as node:
            code, out, err = cles("trace", "pull", "old:speed", "--at", node.url)
        self.assertEqual(code, 0)
        self.assertEqual(err, "cles: no spans of the first node: no_task: old has no PULL\n")
        self.assertEqual(len(out.splitlines()), 3)


class AtANode(NodeTest):
    ARGUMENTS = ("--name", "car1", "--multicast", "off", "--rate", "0")

    def test_pull(self):
        found = self.run_json("trace", "pull", "car1:echo/x", "-o", "json")
        (hop,) = found["request"]["hops"]
        self.assertEqual((hop["node"], hop["request"], hop["outcome"], hop["hops"]), ("car1", "PULL echo", "ok", []))
        self.assertLessEqual(hop["total_us"] + hop["link_us"], found["request"]["total_us"] + 1)

    def test_the_example_of_the_protocol(self):
        page = Path(__file__).resolve().parents[2] / "docs" / "protocol.md"
        section = page.read_text(encoding="utf-8").partition("\n## Traces\n")[2].partition("\n## ")[0]
        example = re.search(r"^```\n(PULL .*?)^```", section, re.MULTILINE | re.DOTALL)[1].splitlines()
        self.assertEqual(len(example), 4)
        for request, reply in zip(example[::2], example[1::2]):
            self.assertEqual(self.without_times(self.node.ask(request)), self.without_times(reply))

    @staticmethod
    def without_times(line):
        """Nor the random id of the node's own span."""
        return re.sub(r'"(span":"[0-9a-f]{16}"|\w+_us":[0-9.]+)', "...", line)

    def test_delegate(self):
        found = self.run_json("trace", "DELEGATE", "self:sleep/30", "-o", "json")
        (hop,) = found["request"]["hops"]
        self.assertGreaterEqual(hop["run_us"], 25_000)

    def test_exit_codes(self):
        self.assertEqual(self.run_at("trace", "pull", "car1:nothing")[0], 3)
        self.assertEqual(self.run_at("trace", "delegate", "car1:sleep/60000", "-t", "50ms")[0], 4)
        self.assertEqual(self.run_at("trace", "delegate", "car1:fail")[0], 5)
        for wrong in (["trace"], ["trace", "pull"], ["trace", "bind", "car1:echo"], ["trace", "pull", "echo"],
                      ["trace", "pull", "car1:echo", "-d", "{}"], ["trace", "push", "car1:echo", "-d", "{"]):
            code, out, err = self.run_at(*wrong)
            self.assertEqual((code, out), (2, ""), wrong)
            self.assertIn("cles: ", err)

    def test_completion(self):
        def offered(*words):
            code, out, _ = cles("__complete", "trace", *words)
            self.assertEqual(code, 0)
            return {line.split("\t")[0] for line in out.splitlines()}

        self.assertEqual(offered("pu"), {"pull", "push"})
        self.assertIn("self:echo/", offered("--at", self.node.url, "pull", "self:e"))
        self.assertEqual(offered("--at", self.node.url, "delegate", "self:sl"), {"self:sleep/"})


if __name__ == "__main__":
    unittest.main(verbosity=2)
