#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles top`: the load of nodes, as it changes."""

import json
import signal
import unittest

from support import Node, ScriptedNode, cles, environment, finish, free_port, id_of, on_terminal, read_line, start


GROUP = f"lo,239.255.25.37:{free_port()}"
ENVIRONMENT = environment(CLES_MULTICAST=GROUP, NO_COLOR="1")


class Top(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.nodes = [Node("--name", name, "--multicast", GROUP, "--rate", "0") for name in ("car1", "car2")]

    @classmethod
    def tearDownClass(cls):
        codes = [node.stop() for node in cls.nodes]
        if any(codes):
            raise AssertionError(f"nodes ended with {codes}")

    def watch(self, *arguments):
        """All documents of a complete run."""
        code, out, err = cles("top", "-o", "json", *arguments, env=ENVIRONMENT)
        self.assertEqual((code, err), (0, ""))
        return [json.loads(line)["nodes"] for line in out.splitlines()]

    def test_each_look_is_a_document(self):
        first, second = self.watch("-n", "2", "-i", "500ms")
        for nodes in (first, second):
            self.assertEqual([node["node"] for node in nodes], ["car1", "car2"])
            for node in nodes:
                self.assertEqual(node["state"], "live")
                self.assertEqual(node["load"], {"queued": 0, "running": 0, "workers": 0})
                self.assertNotIn("failure", node)
        self.assertNotIn("requests_per_s", first[0])
        self.assertEqual(second[0]["requests_per_s"], 0)  # its own requests do not count
        self.assertEqual(second[0]["errors_per_s"], 0)

    def test_rates(self):
        top = start("top", "-o", "json", "-i", "1s", env=ENVIRONMENT)
        read_line(top)
        s, answers = self.nodes[1].connect()
        with s, answers:
            seen = None
            while not seen:  # sends requests until they appear
                s.sendall(b"PULL self:echo\nPULL self:nothing\n" * 20)
                for _ in range(40):
                    answers.readline()
                nodes = json.loads(read_line(top))["nodes"]
                seen = [node for node in nodes if node["node"] == "car2" and node["errors_per_s"] > 0]
        self.assertGreater(seen[0]["requests_per_s"], seen[0]["errors_per_s"])
        self.assertGreaterEqual(seen[0]["handler_p99_us"], seen[0]["handler_p50_us"])
        top.send_signal(signal.SIGINT)
        self.assertEqual(finish(top)[0], 130)

    def test_who_has_most_to_do_comes_first(self):
        working = start("delegate", "car2:sleep/60000", "-t", "60s", env=ENVIRONMENT)
        top = start("top", "-o", "json", "-i", "200ms", env=ENVIRONMENT)
        try:
            while (nodes := json.loads(read_line(top))["nodes"])[0]["node"] != "car2":
                self.assertEqual([node["node"] for node in nodes], ["car1", "car2"])  # until it has reported
            self.assertEqual(nodes[0]["load"]["running"], 1)
            self.assertEqual(self.watch("--sort", "name", "-n", "1")[0][0]["node"], "car1")
        finally:
            for process in (top, working):
                process.send_signal(signal.SIGINT)
                self.assertEqual(finish(process)[0], 130)

    def test_as_a_table(self):
        code, out, err = cles("top", "-n", "2", "-i", "200ms", "-o", "table", env=ENVIRONMENT)
        self.assertEqual((code, err), (0, ""))
        first, second = out.split("\n\n")
        self.assertEqual(first.splitlines()[0].split(), ["NODE", "STATE", "WORKERS", "RUNNING", "QUEUED", "OUT",
                                                         "IN", "REQ/S", "ERR/S", "P50", "P99", "LAST", "SEEN"])
        self.assertRegex(first.splitlines()[1], r"^car1 +live +- +0 +0 +0 +0 +- +- ")
        self.assertRegex(second.splitlines()[1], r"^car1 +live +- +0 +0 +0 +0 +0 +0 ")

    def test_a_node_and_those_that_it_knows(self):
        nodes = self.watch("-n", "1", "--at", self.nodes[0].url, "--sort", "name")[0]
        self.assertEqual(nodes[0]["node"], "car1")
        self.assertEqual(nodes[0]["load"]["queued"], 0)

    def test_on_a_terminal_it_is_one_screen(self):
        for keys, wanted in ((b"q", 0), (b"\x03", 130)):
            code, shown = on_terminal("top", "-i", "200ms", env=ENVIRONMENT, interrupt_after=b"car2", keys=keys)
            self.assertEqual(code, wanted)
            self.assertTrue(shown.startswith("\x1b[?1049h"), shown)
            self.assertTrue(shown.endswith("\x1b[?1049l"), shown)
            self.assertIn("\x1b[Hcles top  2 nodes, 0 requests/s, 0 running, 0 queued  (every 200 ms; q quits)", shown)

    def test_a_terminal_that_cannot(self):
        code, shown = on_terminal("top", "-n", "1", env={**ENVIRONMENT, "TERM": "dumb"})
        self.assertEqual(code, 0)
        self.assertTrue(shown.startswith("NODE "), shown)


class Spans(unittest.TestCase):
    def show(self, p99):
        """The table of a node whose handlers took this many microseconds."""
        handlers = {"samples": 2, "p50": 6.143, "p99": p99}

        def answer(line, send):
            replies = {"metrics": {"requests": {"PULL": 1}, "errors": 0, "handler_us": handlers}, "peers": {"peers": []},
                       "cles": {"node": "car9", "epoch": "00000001", "endpoints": [node.url]}}
            send(id_of(line) + json.dumps(next(reply for word, reply in replies.items() if word in line)))

        with ScriptedNode(answer) as node:
            code, out, err = cles("top", "-n", "1", "-o", "table", "--at", node.url)
        self.assertEqual(code, 0, err)
        return out

    def test_a_span_has_the_unit_that_keeps_it_short(self):
        for p99, shown in ((3221225.5, "3.22 s"), (12345.6, "12.35 ms"), (999.9, "999.9 us")):
            self.assertRegex(self.show(p99), rf" 6\.1 us +{shown} ")


class Failures(unittest.TestCase):
    def test_nobody_is_there_at_first(self):
        code, out, err = cles("top", "--at", "tcp://127.0.0.1:1")
        self.assertEqual((code, out), (1, ""))
        self.assertTrue(err.startswith("cles: "), err)

    def test_who_goes_later_may_come_back(self):
        node = Node("--multicast", "off")
        top = start("top", "-o", "json", "-i", "100ms", "--at", node.url)
        self.assertEqual(json.loads(read_line(top))["nodes"][0]["node"], "car1")
        self.assertEqual(node.stop(), 0)
        while json.loads(read_line(top))["nodes"]:
            pass
        self.assertIn("cles: ", read_line(top, top.stderr))
        top.send_signal(signal.SIGINT)
        self.assertEqual(finish(top)[0], 130)


if __name__ == "__main__":
    unittest.main()
