#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""What hostile clients send: others are served meanwhile, and nothing grows."""

import hashlib
import json
import socket
import tempfile
import unittest

from gateway_support import FakeNodes, Gateway, own_group, read_all
from support import wait_until


class Limits(unittest.TestCase):
    def start(self, *arguments):
        gateway = Gateway(*arguments)
        self.addCleanup(lambda: self.assertEqual(gateway.stop(), 0))
        return gateway

    def open(self, gateway, count, text=b""):
        clients = []
        for _ in range(count):
            clients.append(gateway.raw())
            self.addCleanup(clients[-1].close)
            if text:
                clients[-1].sendall(text)
        return clients

    def read_nothing(self, gateway, count, fields=""):
        """Clients that ask for what fake1 replies, and read its first line only."""
        clients = []
        for number in range(count):
            client = socket.socket()
            self.addCleanup(client.close)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # so that it waits in the gateway
            client.connect(("127.0.0.1", gateway.port))
            client.sendall(f"GET /pull/fake1/cles HTTP/1.1\r\nHost: localhost\r\n{fields}\r\n".encode())
            self.assertTrue(client.recv(12, socket.MSG_WAITALL).endswith(b" 200"), number)
            clients.append(client)
        return clients

    def test_idle_connections_give_way(self):
        gateway = self.start("--connections", "8", "--connections-per-address", "100")
        self.open(gateway, 8)
        self.open(gateway, 8, b"GET /pull/self/cl")
        for _ in range(3):
            self.assertEqual(gateway.get("/pull/self/cles").status, 200)
        wait_until(lambda: gateway.counted("connections_open") <= 8, "no more than 8")
        self.assertGreaterEqual(gateway.counted("connections_evicted"), 8)

    def test_who_reads_no_responses_gives_way(self):
        gateway = self.start("--connections", "4", "--connections-per-address", "100")
        requests = b"GET /pull/self/cles HTTP/1.1\r\nHost: evil.example\r\n\r\n" * 1000
        for client in self.open(gateway, 4):
            client.settimeout(0.5)
            with self.assertRaises(TimeoutError):  # the gateway reads no more requests until its responses are read
                for _ in range(10_000):
                    client.sendall(requests)
        self.assertEqual(gateway.get("/pull/self/cles").status, 200)
        self.assertGreaterEqual(gateway.counted("connections_evicted"), 1)

    def test_responses_that_nobody_reads_have_a_limit_together(self):
        env = own_group()
        gateway = Gateway(env=env)
        self.addCleanup(lambda: self.assertEqual(gateway.stop(), 0))
        nodes = FakeNodes(env, ["fake1"], '{"more":"' + "x" * (7 << 20) + '"}')
        self.addCleanup(nodes.close)
        wait_until(lambda: gateway.ask("GET", "/pull/fake1/cles").status == 200, "it is known")
        clients = self.read_nothing(gateway, 9)
        refused = gateway.get("/pull/fake1/cles")
        self.assertEqual((refused.status, json.loads(refused.body)["error"], refused.headers["Retry-After"]), (503, "busy", "1"))
        self.assertTrue(json.loads(gateway.post("/push/fake1/cles2").body)["ran"])
        self.assertEqual(gateway.get("/pull/self/cles").status, 200)
        clients[0].close()
        wait_until(lambda: gateway.get("/pull/fake1/cles").status == 200, "there is room again")

    def test_a_token_has_a_share_of_them(self):
        with tempfile.NamedTemporaryFile("w") as tokens:
            for member in ("greedy", "other"):
                tokens.write(f"{member} {hashlib.sha256(member.encode()).hexdigest()}\n")
            tokens.flush()
            env = own_group()
            gateway = Gateway("--tokens", tokens.name, env=env)
            self.addCleanup(lambda: self.assertEqual(gateway.stop(), 0))
            nodes = FakeNodes(env, ["fake1"], '{"more":"' + "x" * (7 << 20) + '"}')
            self.addCleanup(nodes.close)

            def status(member):
                return gateway.get("/pull/fake1/cles", Authorization=f"Bearer {member}").status
            wait_until(lambda: status("other") == 200, "it is known")
            clients = self.read_nothing(gateway, 2, "Authorization: Bearer greedy\r\n")
            self.assertEqual((status("greedy"), status("other")), (503, 200))
            clients[0].close()
            wait_until(lambda: status("greedy") == 200, "there is room again")

    def test_an_address_has_a_limit(self):
        gateway = self.start("--connections", "100", "--connections-per-address", "4")
        clients = self.open(gateway, 6)
        for client in clients[:2]:
            self.assertEqual(read_all(client), "")  # they were closed for others
        self.assertEqual(gateway.get("/pull/self/cles").status, 200)

    def test_what_is_too_large(self):
        gateway = self.start()
        head = "POST /push/self/x HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
        for text, status in ((f"GET /{'a' * 20_000} HTTP/1.1\r\n", "431"), (f"{head}A: {'b' * 20_000}", "431"),
                             (head + "A: b\r\n" * 101 + "\r\n", "431"), (f"{head}Content-Length: 100000000\r\n\r\n", "413")):
            with self.subTest(status=status, size=len(text)):
                self.assertTrue(gateway.exchange(text).startswith(f"HTTP/1.1 {status} "))
        self.assertEqual(gateway.get("/pull/self/cles").status, 200)

    def test_what_is_no_http(self):
        gateway = self.start()
        for text in ("PULL self:cles\n\r\n\r\n", "\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + "\x00" * 40 + "\r\n\r\n",
                     "GET / HTTP/3.0\r\nHost: localhost\r\n\r\n", "GET / HTTP/1.1\r\n\r\n", "\r\n\r\n\r\n"):
            with self.subTest(text=text):
                self.assertRegex(gateway.exchange(text), r"^HTTP/1\.1 (400|505) ")
        self.assertEqual(gateway.get("/pull/self/cles").status, 200)

    def test_the_body_of_one_that_is_refused_is_not_read(self):
        gateway = self.start()
        with gateway.raw() as client:
            client.sendall(b"POST /push/self/x HTTP/1.1\r\nHost: evil.example\r\nContent-Length: 1000000\r\n\r\n" + b" " * 100_000)
            self.assertTrue(read_all(client).startswith("HTTP/1.1 421 "))


if __name__ == "__main__":
    unittest.main()
