#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles serve`: its tasks on the wire, its endpoints, its termination."""

import json
import os
import signal
import socket
import time
import unittest
from datetime import datetime, timezone

from support import PATIENCE, Node, NodeTest, cles, finish, read_line, start


class Tasks(NodeTest):
    ARGUMENTS = ("--rate", "50")

    def test_prints_an_endpoint_per_line(self):
        self.assertRegex(self.node.lines[0], r"^car1 listening on tcp://127\.0\.0\.1:\d+\n$")
        self.assertEqual(self.node.lines[1], f"car1 listening on {self.node.unix}\n")

    def test_localization_fits_the_papers_packet(self):
        line = self.node.ask("PULL car1:localization id=1234567890123456789")
        self.assertTrue(line.startswith("id=1234567890123456789 {"), line)
        self.assertLessEqual(len(line) + 1, 132)
        packet = json.loads(line.split(" ", 1)[1])
        self.assertEqual(list(packet), ["utc", "lat", "lon", "velocity", "acceleration"])
        self.assertLess(abs(packet["utc"] - time.time()), PATIENCE)
        self.assertTrue(20 <= packet["velocity"] <= 30, packet)
        self.assertTrue(-1 <= packet["acceleration"] <= 1, packet)
        for value, digits in zip(packet.values(), (3, 6, 6, 2, 2)):
            self.assertEqual(value, round(value, digits))

    def test_localization_is_published(self):
        s, lines = self.node.connect()
        with s, lines:
            s.sendall(b"BIND car1:localization\n")
            self.assertTrue(lines.readline().startswith('{"utc":'))
            numbers = []
            for _ in range(3):
                head, _, body = lines.readline().partition(" {")
                self.assertRegex(head, r"^UPDATE car1:localization seq=\d+ epoch=[0-9a-f]{8}$")
                numbers.append(int(head.split("seq=")[1].split()[0]))
                json.loads("{" + body)
            self.assertEqual(numbers, list(range(numbers[0], numbers[0] + 3)))

    def test_localization_takes_no_parameters(self):
        for verb in ("PULL", "BIND"):
            answer = json.loads(self.node.ask(f"{verb} car1:localization/fast"))
            self.assertEqual(answer, {"error": "bad_request", "message": "car1: localization takes no parameters"})

    def test_the_vehicle_moves_as_it_says(self):
        first = json.loads(self.node.ask("PULL car1:localization"))
        time.sleep(0.2)  # the elapsed time is what is measured
        second = json.loads(self.node.ask("PULL car1:localization"))
        north = (second["lat"] - first["lat"]) * 111320
        east = (second["lon"] - first["lon"]) * 111320 * 0.6663
        way = (north**2 + east**2) ** 0.5
        speed = way / (second["utc"] - first["utc"])
        self.assertLess(abs(speed - (first["velocity"] + second["velocity"]) / 2), 3)

    def test_system_time_as_in_the_paper(self):
        for command in ("PULL car1:systemTime", "PULL car1:systemTime/UTC", "DELEGATE car1:systemTime",
                        "DELEGATE car1:systemTime/UTC"):
            answer = json.loads(self.node.ask(command))
            self.assertEqual(list(answer), ["systemTime"], command)
            moment = datetime.strptime(answer["systemTime"].split(".")[0].rstrip("Z"), "%Y-%m-%dT%H:%M:%S")
            self.assertLess(abs(moment.replace(tzinfo=timezone.utc).timestamp() - time.time()), PATIENCE)
        for zone in ("TAI", "utc", "UTC/UTC"):
            self.assertEqual(json.loads(self.node.ask(f"PULL car1:systemTime/{zone}")),
                             {"error": "bad_request", "message":
                              "car1: the only time zone of systemTime is UTC, as in systemTime/UTC"})

    def test_echo(self):
        self.assertEqual(self.node.ask("PULL car1:echo/a%20b/2"), '{"parameters":["a b","2"]}')
        self.assertEqual(self.node.ask("PULL car1:echo"), '{"parameters":[]}')
        self.assertEqual(self.node.ask('PUSH car1:echo {"x":[1,2.50]}'), '{"x":[1,2.50]}')
        self.assertEqual(self.node.ask('DELEGATE car1:echo {"x":1}'), '{"x":1}')
        self.assertEqual(self.node.ask("DELEGATE car1:echo [1]"), "[1]")

    def test_sleep_with_progress_in_tenths(self):
        s, lines = self.node.connect()
        with s, lines:
            s.sendall(b"DELEGATE car1:sleep/50 id=7 progress=yes\n")
            got = []
            while not got or "progress=" in got[-1]:
                got.append(lines.readline().rstrip("\n"))
        self.assertEqual(got, [f"id=7 progress=0.{i} {{}}" for i in range(1, 10)] + ['id=7 {"slept_ms":50}'])

    def test_sleep_stops_at_once_when_it_is_withdrawn(self):
        s, lines = self.node.connect()
        with s, lines:
            begun = time.monotonic()
            s.sendall(b"DELEGATE car1:sleep/20000 id=7 deadline=25000\nPUSH self:cles/cancel/7 id=8\n")
            answers = {lines.readline().split(" ", 1)[0]: None for _ in range(2)}
            self.assertEqual(sorted(answers), ["id=7", "id=8"])
            self.assertLess(time.monotonic() - begun, 15)
        metrics = json.loads(self.node.ask("PULL self:cles/metrics"))
        self.assertTrue(metrics)

    def test_sleep_wants_milliseconds(self):
        for noun in ("sleep", "sleep/x", "sleep/-1", "sleep/1/2", "sleep/99999999999"):
            answer = json.loads(self.node.ask(f"DELEGATE car1:{noun}"))
            self.assertEqual(answer["error"], "bad_request", noun)

    def test_fail(self):
        self.assertEqual(json.loads(self.node.ask("DELEGATE car1:fail")),
                         {"error": "failed", "message": "car1: this task always fails"})

    def test_notice_goes_to_all_that_are_bound(self):
        s, lines = self.node.connect()
        with s, lines:
            s.sendall(b"BIND car1:notice\n")
            lines.readline()
            self.assertEqual(self.node.ask('UPDATE car1:notice {"text":"hi"}'), "{}")
            self.assertRegex(lines.readline(), r'^UPDATE car1:notice seq=\d+ epoch=[0-9a-f]{8} \{"text":"hi"\}\n$')

    def test_describes_its_tasks(self):
        about = json.loads(self.node.ask("PULL self:cles"))
        self.assertEqual(about["node"], "car1")
        self.assertEqual(about["endpoints"], [self.node.url, self.node.unix])
        tasks = {(t["verb"].upper(), t["task"]) for t in about["tasks"]}
        self.assertGreaterEqual(tasks, {
            ("PULL", "localization"), ("BIND", "localization"), ("PULL", "systemTime"), ("DELEGATE", "systemTime"),
            ("PULL", "echo"), ("PUSH", "echo"), ("DELEGATE", "echo"),
            ("DELEGATE", "sleep"), ("DELEGATE", "fail"), ("BIND", "notice"), ("UPDATE", "notice")})


class Life(unittest.TestCase):
    def test_sigterm_and_sigint_stop_it_cleanly(self):
        for number in (signal.SIGTERM, signal.SIGINT):
            node = Node()
            s, lines = node.connect()
            with s, lines:
                s.sendall(b"BIND car1:localization\nDELEGATE car1:sleep/20000 id=7\n")
                lines.readline()
                folder = node.folder
                self.assertEqual(node.stop(number), 0)
            self.assertFalse(os.path.exists(folder))

    def test_removes_its_socket_file(self):
        node = Node()
        node.process.terminate()
        self.assertEqual(finish(node.process)[0], 0)
        self.assertFalse(os.path.exists(node.path))
        node.stop()

    def test_serves_on_though_a_client_breaks_off(self):
        node = Node("--rate", "1000")
        for _ in range(5):
            s, lines = node.connect()
            s.sendall(b"BIND car1:localization\n")
            lines.readline()
            lines.close()
            s.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # a reset, not an end
            s.close()
        self.assertIn('"node":"car1"', node.ask("PULL self:cles"))
        self.assertEqual(node.stop(), 0)

    def test_without_a_rate_nothing_is_published(self):
        node = Node("--rate", "0", "--name", "car7")
        self.assertEqual(node.ask("BIND car7:localization"), "{}")
        self.assertIn('"utc":', node.ask("PULL car7:localization"))
        self.assertEqual(node.stop(), 0)

    def test_logs_to_stderr_without_colours(self):
        node = Node("-v")
        node.ask("PULL self:cles")
        node.process.terminate()
        finish(node.process)
        log = node.errors()
        node.stop()
        self.assertIn("stopping on SIGTERM", log)
        self.assertNotIn("\x1b", log)

    def test_port_taken(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            url = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
            code, out, err = cles("serve", "--listen", url)
        self.assertEqual((code, out), (1, ""))
        self.assertIn(url, err)
        self.assertIn("in use", err)

    def test_listening_beyond_this_host_is_asked_for(self):
        code, out, err = cles("serve", "--listen", "tcp://0.0.0.0:0")
        self.assertEqual((code, out), (2, ""))
        self.assertIn("insecure", err)
        process = start("serve", "--listen", "tcp://0.0.0.0:0", "--insecure")
        self.assertRegex(read_line(process), r"^car1 listening on tcp://0\.0\.0\.0:\d+\n$")
        process.terminate()
        self.assertEqual(finish(process)[0], 0)

    def test_bad_arguments(self):
        for arguments in (("--listen", "nowhere"), ("--listen", "carrier-pigeon://x"), ("--name", "a b"), ("--name", "all"),
                          ("--rate", "-1"), ("--rate", "x"), ("--listen", "inproc://here"), ("--listen", "tcp://127.0.0.1:99999"), ("extra",)):
            code, out, err = cles("serve", *arguments)
            self.assertEqual((code, out), (2, ""), (arguments, err))
            self.assertTrue(err.startswith("cles: "), err)


if __name__ == "__main__":
    unittest.main()
