#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Requests over HTTP, as clients send them."""

import json
import unittest

from gateway_support import Gateway, read_all
from support import Node, wait_until


class Requests(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.node = Node()
        cls.gateway = Gateway("--peer", f"car1={cls.node.url}")

    @classmethod
    def tearDownClass(cls):
        codes = (cls.gateway.stop(), cls.node.stop())
        if codes != (0, 0):
            raise AssertionError(f"they ended with {codes}")

    def good(self, reply):
        self.assertEqual(reply.status, 200, reply)
        self.assertEqual(reply.headers["Content-Type"], "application/json")
        return json.loads(reply.body)

    def failed(self, reply, status, code, says=""):
        self.assertEqual(reply.status, status, reply)
        failure = json.loads(reply.body)
        self.assertEqual(failure["error"], code, reply)
        self.assertIn(says, failure["message"])
        return reply

    def test_the_verbs(self):
        self.assertEqual(set(self.good(self.gateway.get("/pull/car1/localization"))),
                         {"utc", "lat", "lon", "velocity", "acceleration"})
        self.assertEqual(self.good(self.gateway.post("/push/car1/echo", '{\n"a": 1\n}')), {"a": 1})
        self.assertEqual(self.good(self.gateway.post("/delegate/car1/echo", "[1, 2]")), [1, 2])
        self.assertEqual(self.good(self.gateway.post("/update/car1/notice", '{"text": "closed"}')), {})

    def test_parameters_and_bodies(self):
        told = self.good(self.gateway.get("/pull/car1/echo/one/a%2Fb/%C3%A4%20%3F"))
        self.assertEqual(told, {"parameters": ["one", "a/b", "ä ?"]})
        self.assertEqual(self.good(self.gateway.post("/push/car1/echo", "3")), {"value": 3})
        self.assertEqual(self.good(self.gateway.post("/delegate/car1/sleep/10")), {"slept_ms": 10})

    def test_failures(self):
        self.failed(self.gateway.get("/pull/car1/speed"), 404, "no_task", "car1 has no PULL 'speed'")
        self.failed(self.gateway.get("/pull/car9/speed"), 404, "no_target")
        self.failed(self.gateway.post("/delegate/car1/fail"), 500, "failed", "this task always fails")
        self.failed(self.gateway.post("/delegate/car1/sleep/x"), 400, "bad_request")
        self.failed(self.gateway.post("/delegate/car1/sleep/60000", Cles_Deadline="50"), 504, "deadline")

    def test_what_is_wrong_with_a_request(self):
        reply = self.failed(self.gateway.get("/push/car1/echo"), 405, "bad_request")
        self.assertEqual(reply.headers["Allow"], "POST")
        self.failed(self.gateway.post("/push/car1/echo", "{}", Content_Type="text/plain"), 415, "bad_request")
        self.failed(self.gateway.post("/push/car1/echo", "{"), 400, "bad_request", "not valid JSON")
        self.failed(self.gateway.get("/pull/car1/../car2"), 400, "bad_request")
        self.failed(self.gateway.post("/push/self/cles/hello"), 403, "denied")
        self.failed(self.gateway.post("/delegate/car1/echo", Cles_Deadline="soon"), 400, "bad_request")
        self.failed(self.gateway.get("/nothing"), 404, "no_target")
        self.failed(self.gateway.ask("GET", "/pull/car1/localization", "{}"), 400, "bad_request")

    def test_the_page(self):
        reply = self.gateway.get("/")
        self.assertEqual((reply.status, reply.headers["Content-Type"]), (200, "text/html; charset=utf-8"))
        self.assertIn("default-src 'none'", reply.headers["Content-Security-Policy"])
        self.assertEqual(self.good(self.gateway.get("/session")), {"node": "gateway", "name": "", "secured": False})

    def test_several_requests_on_one_connection(self):
        one = "GET /pull/car1/echo/{} HTTP/1.1\r\nHost: localhost\r\n{}\r\n"
        text = self.gateway.exchange(one.format(1, "") + one.format(2, "") + one.format(3, "Connection: close\r\n"))
        self.assertEqual(text.count("HTTP/1.1 200 OK\r\n"), 3)
        self.assertEqual([text.index(f'["{i}"]') for i in (1, 2, 3)], sorted(text.index(f'["{i}"]') for i in (1, 2, 3)))

    def test_what_follows_a_refusal_is_not_served(self):
        for length in ("Transfer-Encoding: chunked\r\n", "Content-Length: 5\r\nContent-Length: 0\r\n",
                       "Content-Length: 9999999\r\n"):
            text = self.gateway.exchange(f"POST /push/car1/echo HTTP/1.1\r\nHost: localhost\r\n{length}\r\n"
                                         "GET /pull/car1/echo/smuggled HTTP/1.1\r\nHost: localhost\r\n\r\n")
            self.assertRegex(text, r"^HTTP/1\.1 4(00|11|13) ")
            self.assertNotIn("smuggled", text)
            self.assertEqual(text.count("HTTP/1.1 "), 1)

    def test_a_response_without_a_body_ends_with_its_head(self):
        text = self.gateway.exchange("HEAD /pull/car1/echo/1 HTTP/1.1\r\nHost: localhost\r\n\r\n"
                                     "GET /pull/car1/echo/2 HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        self.assertRegex(text, r"^HTTP/1\.1 405 (?s:.)*?\r\n\r\nHTTP/1\.1 200 OK\r\n")

    def test_a_client_may_wait_before_it_sends_the_body(self):
        with self.gateway.raw() as client:
            client.sendall(b"POST /push/car1/echo HTTP/1.1\r\nHost: localhost\r\nExpect: 100-continue\r\nConnection: close\r\n"
                           b"Content-Type: application/json\r\nContent-Length: 2\r\n\r\n")
            self.assertEqual(client.recv(1024), b"HTTP/1.1 100 Continue\r\n\r\n")
            client.sendall(b"{}")
            self.assertTrue(read_all(client).startswith("HTTP/1.1 200 OK\r\n"))

    def test_a_client_that_goes_cancels_its_request(self):
        def running():
            return json.loads(self.node.ask("PULL self:cles/metrics"))["handlers_running"]

        gone = self.gateway.counted("clients_gone")
        with self.gateway.raw() as client:
            client.sendall(b"POST /delegate/car1/sleep/600000 HTTP/1.1\r\nHost: localhost\r\nCles-Deadline: 600000\r\n"
                           b"Content-Length: 0\r\n\r\n")
            wait_until(lambda: running() == 1, "it runs")
        wait_until(lambda: running() == 0, "it is cancelled")
        self.assertEqual(self.gateway.counted("clients_gone"), gone + 1)


if __name__ == "__main__":
    unittest.main()
