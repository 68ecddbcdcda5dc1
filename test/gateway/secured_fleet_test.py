#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A gateway of a secured fleet: each token is a member's, whose rights count."""

import json
import re
import signal
import unittest

from gateway_support import Events, Gateway
from support import environment, finish, free_port, read_line, start, wait_until
from trust_support import Trust


class SecuredFleet(Trust):
    """car1, and the gateway door, which may forward for operator and viewer, but not for stranger."""

    def setUp(self):
        super().setUp()
        self.env = environment(CLES_MULTICAST=f"lo,239.255.0.9:{free_port()}")
        self.good("fleet", "init", "fleet", "--with", "car1,door,operator,viewer,stranger")
        self.rights("door", "--may", "none", "--forwards", "operator", "--forwards", "viewer")
        self.rights("viewer", "--may", "pull *:echo/**")
        self.car = self.serve()
        self.tokens = {name: self.good("gateway", "--new-token", name, "--tokens", "tokens").out.strip()
                       for name in ("operator", "viewer", "stranger", "nobody")}
        self.door = Gateway("--keys", "fleet/door", "--tokens", "tokens", "--listen", "tls://127.0.0.1:0", "--peer",
                            f"car1={self.car}", env=self.env, cwd=self.scratch)
        self.addCleanup(lambda: self.assertEqual(self.door.stop(), 0))

    def rights(self, name, *terms):
        self.good("fleet", "rights", name, *terms, "-k", "fleet")
        for member in ("car1", "door", "operator"):
            self.good("keys", "join", "fleet/roster", "-k", f"fleet/{member}")

    def serve(self):
        process = start("serve", "-k", "fleet/car1", "-l", "tls://127.0.0.1:0", cwd=self.scratch, env=self.env)
        self.addCleanup(self.end, process)
        found = re.fullmatch(r"car1 listening on (tls://127\.0\.0\.1:\d+)\n", read_line(process))
        self.assertTrue(found)
        return found[1]

    def end(self, process):
        process.send_signal(signal.SIGTERM)
        self.assertEqual(finish(process)[0], 0)

    def ask(self, name, method, path, body=None):
        reply = self.door.ask(method, path, body, Authorization=f"Bearer {self.tokens[name]}")
        return reply.status, json.loads(reply.body)

    def test_the_rights_are_those_of_the_member(self):
        self.assertEqual(self.ask("operator", "GET", "/pull/car1/echo/1"), (200, {"parameters": ["1"]}))
        self.assertEqual(self.ask("operator", "POST", "/push/car1/echo", "{}"), (200, {}))
        self.assertEqual(self.ask("viewer", "GET", "/pull/car1/echo/1"), (200, {"parameters": ["1"]}))
        status, failure = self.ask("viewer", "POST", "/push/car1/echo", "{}")
        self.assertEqual((status, failure["error"]), (403, "denied"))
        self.assertEqual(self.ask("operator", "GET", "/session"), (200, {"node": "door", "name": "operator", "secured": True}))

    def test_the_gateway_needs_the_right_to_forward(self):
        for name in ("stranger", "nobody"):
            status, failure = self.ask(name, "GET", "/pull/car1/echo/1")
            self.assertEqual((status, failure["error"]), (403, "denied"), name)
        self.assertEqual(self.door.get("/pull/car1/echo/1").status, 401)

    def test_a_stream_ends_with_the_right(self):
        token = {"Authorization": f"Bearer {self.tokens['operator']}"}
        with Events(self.door, "/bind/car1/localization", **token) as stream:
            self.assertEqual(stream.next()[0], "message")
            self.rights("door", "--may", "none", "--forwards", "viewer")
            self.good("pull", "car1:echo/1", "-k", "fleet/operator", "--at", self.car, env=self.env)  # which brings the roster
            kind = "message"
            while kind == "message":
                kind = stream.next()[0]
            self.assertIn(kind, ("lost", "failure"))

    def test_what_others_may_not_ask_is_left_out(self):
        def shown(name):
            return self.door.get("/metrics", Authorization=f"Bearer {self.tokens[name]}").body

        wait_until(lambda: 'node="car1"' in shown("operator"), "they know each other")
        self.assertNotIn('node="car1"', shown("viewer"))


if __name__ == "__main__":
    unittest.main()
