#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Streams of server-sent events: BIND and DELEGATE."""

import http.client
import json
import socket
import unittest

from gateway_support import Events, Gateway, own_group
from support import PATIENCE, Node, wait_until


class Streams(unittest.TestCase):
    def setUp(self):
        self.env = own_group()
        self.node = Node("--multicast", self.env["CLES_MULTICAST"])
        self.addCleanup(self.stop, self.node)
        self.gateway = Gateway("--peer", f"car1={self.node.url}", env=self.env)
        self.addCleanup(self.stop, self.gateway)

    def stop(self, what):
        self.assertEqual(what.stop(), 0)

    def update(self, number, padding=""):
        reply = self.gateway.post("/update/car1/notice", json.dumps({"n": number, "padding": padding}))
        self.assertEqual(reply.status, 200, reply)

    def bind(self, path="/bind/car1/notice", **headers):
        stream = Events(self.gateway, path, **headers)
        self.addCleanup(stream.close)
        self.assertEqual((stream.status, stream.type), (200, "text/event-stream"))
        return stream

    def value_of(self, event):
        self.assertEqual(event[0], "message", event)
        return event[2]["n"]

    def test_updates_have_ids(self):
        self.update(1)
        stream = self.bind()
        kind, first, data = stream.next()
        self.assertEqual((kind, data), ("message", {"n": 1, "padding": ""}))
        self.assertRegex(first, r"^[0-9a-f]{8}\.1$")
        self.update(2)
        self.assertEqual(stream.next()[1], first[:9] + "2")

    def test_a_client_resumes(self):
        self.update(1)
        with self.bind() as stream:
            mark = stream.next()[1]
        stream = self.bind(Last_Event_ID=mark)  # it has the newest value
        self.update(2)
        self.assertEqual(self.value_of(stream.next()), 2)
        self.update(3)
        stream = self.bind(Last_Event_ID=mark)
        self.assertEqual(stream.next(), ("gap", None, {"missed": 1}))
        self.assertEqual(self.value_of(stream.next()), 3)
        stream = self.bind(Last_Event_ID="00000001.7")
        kind, _, data = stream.next()
        self.assertEqual((kind, set(data)), ("restart", {"epoch"}))
        self.assertEqual(self.value_of(stream.next()), 3)

    def test_of_all_nodes(self):
        self.update(1)
        wait_until(lambda: "car1" in json.loads(self.gateway.get("/pull/all/cles").body)["results"], "they know each other")
        stream = self.bind("/bind/all/notice")
        self.assertEqual(stream.next()[2], {"node": "car1", "update": {"n": 1, "padding": ""}})
        self.update(2)
        self.assertEqual(stream.next()[2], {"node": "car1", "update": {"n": 2, "padding": ""}})

    def test_a_publisher_is_lost(self):
        other = Node("--name", "car2")
        gateway = Gateway("--peer", f"car2={other.url}")
        self.addCleanup(self.stop, gateway)
        stream = Events(gateway, "/bind/car2/localization")
        self.addCleanup(stream.close)
        self.assertEqual(stream.next()[0], "message")
        other.stop()
        kind = "message"
        while kind == "message":
            kind, _, data = stream.next()
        self.assertEqual((kind, set(data)), ("lost", {"reason"}))

    def test_a_publisher_that_is_away_is_waited_for(self):
        stream = self.bind("/bind/car3/localization")
        kind, mark, data = stream.next()
        self.assertEqual((kind, mark, set(data)), ("lost", None, {"reason"}))
        node = Node("--name", "car3", "--multicast", self.env["CLES_MULTICAST"])
        self.addCleanup(self.stop, node)
        self.assertEqual(stream.next()[0], "rebound")
        self.assertEqual(stream.next()[0], "message")

    def test_what_cannot_be_bound(self):
        stream = Events(self.gateway, "/bind/car1/nothing")
        self.assertEqual((stream.status, stream.type), (404, "application/json"))

    def test_a_slow_client_loses_the_oldest_and_is_told(self):
        slow_socket = socket.socket()
        slow_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # before it connects
        slow_socket.settimeout(PATIENCE)
        slow_socket.connect(("127.0.0.1", self.gateway.port))
        connection = http.client.HTTPConnection("127.0.0.1", self.gateway.port)
        connection.sock = slow_socket
        slow = Events(self.gateway, "/bind/car1/notice", connection=connection)
        self.addCleanup(slow.close)
        other = self.bind()
        count = 200
        for number in range(1, count + 1):
            self.update(number, "x" * 10_000)
            self.assertEqual(self.value_of(other.next()), number)  # which is not affected
        values, missed = [], 0
        while not values or values[-1] != count:
            kind, _, data = slow.next()
            if kind == "gap":
                missed += data["missed"]
            else:
                values.append(data["n"])
        self.assertEqual(values, sorted(values))
        self.assertGreater(missed, 0)
        self.assertEqual(len(values) + missed, count)

    def test_a_client_that_goes_ends_its_stream(self):
        with self.bind() as stream:
            self.update(1)
            self.assertEqual(self.value_of(stream.next()), 1)
        wait_until(lambda: self.gateway.counted("streams_open") == 0, "the gateway notices")

    def test_a_delegate_tells_its_progress(self):
        with Events(self.gateway, "/delegate/car1/sleep/300", "POST", Accept="text/event-stream") as stream:
            self.assertEqual((stream.status, stream.type), (200, "text/event-stream"))
            fractions = []
            while (event := stream.next())[0] == "progress":
                fractions.append(event[2]["fraction"])
            self.assertEqual(event, ("result", None, {"slept_ms": 300}))
            self.assertIsNone(stream.next())
            self.assertGreater(len(fractions), 0)
            self.assertEqual(fractions, sorted(fractions))

    def test_a_delegate_fails_after_progress(self):
        with Events(self.gateway, "/delegate/car1/sleep/3000", "POST", Accept="text/event-stream",
                    Cles_Deadline="700") as stream:
            self.assertEqual(stream.next()[0], "progress")  # after 300 ms
            while (event := stream.next())[0] == "progress":
                pass
            self.assertEqual((event[0], event[2]["error"]), ("failure", "deadline"))
        stream = Events(self.gateway, "/delegate/car1/fail", "POST", Accept="text/event-stream")
        self.assertEqual((stream.status, stream.type), (500, "application/json"))


if __name__ == "__main__":
    unittest.main()
