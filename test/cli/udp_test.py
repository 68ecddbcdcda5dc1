#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The command over UDP: a node of `cles serve --listen udp://...`, clients with --at and --peer."""

import json
import re
import signal
import socket
import unittest

from support import PATIENCE, cles, finish, read_line, start


class UdpNode(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.process = start("serve", "--listen", "udp://127.0.0.1:0", "--rate", "50")
        cls.line = read_line(cls.process)
        cls.url = re.search(r"udp://\S+", cls.line).group(0)
        cls.port = int(cls.url.rsplit(":", 1)[1])

    @classmethod
    def tearDownClass(cls):
        cls.process.send_signal(signal.SIGTERM)
        code, _, err = finish(cls.process)
        if code != 0:
            raise AssertionError(f"the node ended with {code}: {err}")

    def run_ok(self, *arguments):
        code, out, err = cles(*arguments)
        self.assertEqual((code, err), (0, ""), out)
        return out

    def plain(self):
        s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        s.settimeout(PATIENCE)
        s.connect(("127.0.0.1", self.port))
        return s

    def test_serve_tells_its_endpoint(self):
        self.assertRegex(self.line, r"^car1 listening on udp://127\.0\.0\.1:\d+\n$")

    def test_requests(self):
        self.assertIn("utc", json.loads(self.run_ok("pull", "car1:localization", "--at", self.url)))
        echo = self.run_ok("push", "car1:echo", "-d", '{"a":1}', "--peer", f"car1={self.url}")
        self.assertEqual(json.loads(echo), {"a": 1})
        slept = self.run_ok("delegate", "car1:sleep/50", "--at", self.url)
        self.assertEqual(json.loads(slept), {"slept_ms": 50})
        self.assertEqual(json.loads(self.run_ok("update", "car1:notice", "-d", '{"text":"hi"}', "--at", self.url)), {})

    def test_info(self):
        about = json.loads(self.run_ok("info", self.url, "-o", "json"))
        self.assertEqual((about["node"], about["endpoints"]), ("car1", [self.url]))

    def test_bind(self):
        out = self.run_ok("bind", "car1:localization", "-n", "4", "--at", self.url, "-o", "json")
        self.assertEqual(len(out.splitlines()), 4)
        for line in out.splitlines():
            self.assertIn("lat", json.loads(line))

    def test_ping(self):
        out = self.run_ok("ping", self.url, "-n", "3", "-i", "10ms", "-o", "json")
        summary = json.loads(out.splitlines()[-1])
        self.assertEqual((summary["node"], summary["sent"], summary["received"]), ("car1", 3, 3))

    def test_what_is_too_large_says_to_use_tcp(self):
        body = json.dumps({"x": "y" * 1300})
        code, out, err = cles("push", "car1:echo", "-d", body, "--at", self.url)
        self.assertEqual((code, out), (5, ""))
        self.assertIn("use TCP", err)

    def test_nobody_there_is_a_deadline(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unheard:
            unheard.bind(("127.0.0.1", 0))
            url = f"udp://127.0.0.1:{unheard.getsockname()[1]}"
            code, out, err = cles("pull", "car1:localization", "--at", url, "-t", "300ms")
            self.assertEqual((code, out), (4, ""))
            self.assertIn("deadline", err)
            unheard.settimeout(PATIENCE)
            first, second = unheard.recv(2000), unheard.recv(2000)  # sent, and sent again
            self.assertEqual(first, second)
            sent = re.match(r"^PULL car1:localization id=\d+ deadline=(\d+)\n$", first.decode())
            self.assertTrue(200 < int(sent[1]) <= 300, first)  # the remaining time when it is sent

    def test_a_plain_socket_is_a_client(self):
        with self.plain() as s:
            s.send(b"PULL self:echo/a")
            self.assertEqual(s.recv(2000), b'{"parameters":["a"]}\n')
            s.send(b'PUSH car1:echo {"a":1}')
            self.assertEqual(json.loads(s.recv(2000))["error"], "bad_request")
            for _ in range(2):
                s.send(b'PUSH car1:echo id=7 {"a":1}\n')
                self.assertEqual(s.recv(2000), b'id=7 {"a":1}\n')

    def test_a_plain_binding_lives_for_its_lease(self):
        with self.plain() as s:
            s.send(b"BIND car1:localization lease=300")
            self.assertTrue(s.recv(2000).startswith(b"{"))
            self.assertTrue(s.recv(2000).startswith(b"UPDATE car1:localization seq="))
            s.settimeout(0.5)  # updates come every 20 ms
            with self.assertRaises(TimeoutError):
                while True:
                    s.recv(2000)


class Listening(unittest.TestCase):
    def test_beyond_this_host_it_is_asked_for(self):
        code, out, err = cles("serve", "--listen", "udp://0.0.0.0:0")
        self.assertEqual((code, out), (2, ""))
        self.assertIn("insecure", err)
        process = start("serve", "--listen", "udp://0.0.0.0:0", "--insecure", "--network", "10.0.0.0/8")
        self.assertRegex(read_line(process), r"^car1 listening on udp://0\.0\.0\.0:\d+\n$")
        process.terminate()
        self.assertEqual(finish(process)[0], 0)

    def test_port_taken(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            url = f"udp://127.0.0.1:{taken.getsockname()[1]}"
            code, out, err = cles("serve", "--listen", url)
        self.assertEqual((code, out), (1, ""))
        self.assertIn(url, err)
        self.assertIn("in use", err)

    def test_bad_arguments(self):
        for arguments in (("--listen", "udp://"), ("--listen", "udp://127.0.0.1:99999"), ("--network", "10.0.0.0/99")):
            code, out, err = cles("serve", *arguments)
            self.assertEqual((code, out), (2, ""), (arguments, err))
            self.assertTrue(err.startswith("cles: "), err)


if __name__ == "__main__":
    unittest.main()
