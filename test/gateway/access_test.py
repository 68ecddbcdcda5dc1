#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Who may use the gateway: hosts, origins, tokens and sessions, without security."""

import hashlib
import json
import os
import unittest

from gateway_support import Events, Gateway, send
from support import Node, wait_until
from trust_support import Trust


class Access(Trust):
    def start(self, *arguments):
        gateway = Gateway(*arguments, cwd=self.scratch)
        self.addCleanup(lambda: self.assertEqual(gateway.stop(), 0))
        return gateway

    def start_node(self):
        node = Node()
        self.addCleanup(node.stop)
        return node

    def token_of(self, member):
        return self.good("gateway", "--new-token", member, "--tokens", "tokens").out.strip()

    def test_pages_of_others_are_refused(self):
        gateway = self.start("--host", "Fleet.example", "--allow-origin", "https://fleet.example")
        ask = "/pull/self/cles"
        self.assertEqual(gateway.get(ask).status, 200)
        self.assertEqual(gateway.get(ask, Host="localhost").status, 200)
        self.assertEqual(gateway.get(ask, Host="fleet.example:25380").status, 200)
        self.assertEqual(gateway.get(ask, Host="evil.example").status, 421)
        self.assertEqual(gateway.get("/", Host="evil.example").status, 421)
        self.assertEqual(gateway.get(ask, Origin="http://evil.example").status, 403)
        self.assertEqual(gateway.get(ask, Origin="null").status, 403)
        self.assertEqual(gateway.get(ask, Sec_Fetch_Site="cross-site").status, 403)
        self.assertEqual(gateway.get(ask, Origin=f"http://127.0.0.1:{gateway.port}").status, 200)
        own = f"http://127.0.0.1:{gateway.port}"
        self.assertEqual(gateway.get(ask, Origin=own, Sec_Fetch_Site="same-origin").status, 200)
        self.assertEqual(gateway.get(ask, Origin=own, Sec_Fetch_Site="cross-site").status, 403)
        allowed = gateway.get(ask, Origin="https://fleet.example", Sec_Fetch_Site="cross-site")
        self.assertEqual((allowed.status, allowed.headers["Access-Control-Allow-Origin"]), (200, "https://fleet.example"))
        preflight = gateway.ask("OPTIONS", "/push/self/x", Origin="https://fleet.example")
        self.assertEqual((preflight.status, preflight.headers["Access-Control-Allow-Methods"]), (204, "GET, POST, DELETE"))
        self.assertEqual(gateway.ask("OPTIONS", "/push/self/x", Origin="https://evil.example").status, 403)
        self.assertGreaterEqual(gateway.counted("denied"), 5)

    def test_a_token_is_needed(self):
        token = self.token_of("operator")
        self.assertEqual(self.path("tokens").read_text(), f"operator {hashlib.sha256(token.encode()).hexdigest()}\n")
        gateway = self.start("--tokens", "tokens")
        refused = gateway.get("/session")
        self.assertEqual((refused.status, refused.headers["WWW-Authenticate"]), (401, "Bearer"))
        self.assertEqual(gateway.get("/session", Authorization="Bearer 1234").status, 401)
        self.assertEqual(gateway.get("/metrics").status, 401)
        self.assertEqual(gateway.get("/openapi.json").status, 401)
        self.assertEqual(gateway.get("/pull/self/cles").status, 401)
        self.assertEqual(gateway.get("/").status, 200)  # the page, where it is entered
        for fields in ({"Authorization": f"Bearer {token}"}, {"Sec_WebSocket_Protocol": f"a, cles.token.{token}"}):
            told = gateway.get("/session", **fields)
            self.assertEqual((told.status, json.loads(told.body)),
                             (200, {"node": "gateway", "name": "operator", "secured": False}))

    def test_a_session_stands_for_a_token(self):
        token = self.token_of("operator")
        gateway = self.start("--tokens", "tokens")
        self.assertEqual(gateway.post("/session").status, 401)
        made = gateway.post("/session", Authorization=f"Bearer {token}")
        self.assertEqual(made.status, 204)
        cookie, *terms = made.headers["Set-Cookie"].split("; ")
        self.assertEqual(terms, ["Path=/", "HttpOnly", "SameSite=Strict"])
        self.assertEqual(gateway.get("/pull/self/cles", Cookie=cookie).status, 200)
        self.assertEqual(gateway.get("/pull/self/cles", Cookie=cookie[:-1]).status, 401)
        self.assertNotIn("Set-Cookie", gateway.post("/session", Cookie=cookie).headers)  # it does not prolong itself
        ended = gateway.ask("DELETE", "/session", Cookie=cookie)
        self.assertEqual(ended.status, 204)
        self.assertIn("Max-Age=0", ended.headers["Set-Cookie"])
        self.assertEqual(gateway.get("/pull/self/cles", Cookie=cookie).status, 401)

    def test_a_session_ends_by_the_token_too(self):
        token = {"Authorization": f"Bearer {self.token_of('operator')}"}
        gateway = self.start("--tokens", "tokens")
        cookie = gateway.post("/session", **token).headers["Set-Cookie"].split("; ")[0]
        self.assertEqual(gateway.get("/session", Cookie=cookie).status, 200)
        self.assertEqual(gateway.ask("DELETE", "/session", Cookie=cookie, **token).status, 204)
        self.assertEqual(gateway.get("/session", Cookie=cookie).status, 401)

    def test_a_token_may_be_withdrawn(self):
        operator, viewer = self.token_of("operator"), self.token_of("viewer")
        gateway = self.start("--tokens", "tokens", "--name", "door")
        fields = {"Authorization": f"Bearer {operator}"}
        self.assertEqual(gateway.get("/session", **fields).status, 200)
        kept = self.path("tokens").read_text().splitlines(keepends=True)[1]
        self.path("tokens").write_text(kept)
        wait_until(lambda: gateway.get("/session", **fields).status == 401, "it does not count any more")
        self.assertEqual(gateway.get("/session", Authorization=f"Bearer {viewer}").status, 200)
        # A file that others can read counts for nothing.
        os.chmod(self.path("tokens"), 0o644)
        wait_until(lambda: gateway.get("/session", Authorization=f"Bearer {viewer}").status == 401, "no token counts")
        wait_until(lambda: "chmod 600" in gateway.errors(), "the log says why")
        os.chmod(self.path("tokens"), 0o600)
        wait_until(lambda: gateway.get("/session", Authorization=f"Bearer {viewer}").status == 200, "it counts again")

    def test_a_stream_ends_with_its_token(self):
        token = self.token_of("operator")
        car = self.start_node()
        gateway = self.start("--tokens", "tokens", "--peer", f"car1={car.url}")
        with Events(gateway, "/bind/car1/localization", Authorization=f"Bearer {token}") as stream:
            self.assertEqual(stream.next()[0], "message")
            self.path("tokens").write_text("")
            while (event := stream.next())[0] == "message":
                pass
            self.assertEqual((event[0], event[2]["error"]), ("failure", "denied"))
            self.assertIsNone(stream.next())

    def test_a_delegate_ends_with_its_token(self):
        fields = {"Authorization": f"Bearer {self.token_of('operator')}"}
        car = self.start_node()
        gateway = self.start("--tokens", "tokens", "--peer", f"car1={car.url}")
        whole = gateway.connection()
        self.addCleanup(whole.close)
        send(whole, "POST", "/delegate/car1/sleep/5000", None, fields)
        with Events(gateway, "/delegate/car1/sleep/20000", "POST", Accept="text/event-stream", **fields) as stream:
            self.assertEqual(stream.next()[0], "progress")
            self.path("tokens").write_text("")
            while (event := stream.next())[0] == "progress":
                pass
            self.assertEqual((event[0], event[2]["error"]), ("failure", "denied"))
            self.assertIsNone(stream.next())
        response = whole.getresponse()
        self.assertEqual((response.status, response.headers["WWW-Authenticate"]), (401, "Bearer"))

    def test_options_that_would_let_others_in_are_refused(self):
        self.refused("gateway", "--http", "0.0.0.0:0", says="--cert and --key, or --behind-proxy")
        self.refused("gateway", "--http", "[::]:0", "--tokens", "tokens", says="--cert and --key, or --behind-proxy")
        self.refused("gateway", "--behind-proxy", "--host", "a", says="give --tokens")
        self.refused("gateway", "--behind-proxy", "--tokens", "tokens", says="--host NAME")
        self.refused("gateway", "--keys", "fleet", says="give --tokens")
        self.refused("gateway", "--cert", "a", says="both --cert and --key")
        self.refused("gateway", "--http", "localhost", says="an address and a port")
        self.refused("gateway", "--http", "1.2.3.4:port", says="an address and a port")
        self.refused("gateway", "--allow-origin", "fleet.example", says="a scheme and a host")
        self.refused("gateway", "--nats", "nats://a", says="--pool NAME")
        self.refused("gateway", "--http", "127.0.0.1:0", "--peer", "self=tcp://127.0.0.1:1", says="self is not the name of a node")
        self.refused("gateway", "--new-token", "operator", says="--tokens")
        self.refused("gateway", "--new-token", "a b", "--tokens", "tokens", says="the name of a member")
        self.refused("gateway", "--connections", "0", says="--connections")

    def test_what_cannot_be_used(self):
        self.failed("gateway", "--http", "127.0.0.1:0", "--tokens", "nowhere", says="nowhere")
        self.path("tokens").write_text("operator\n")
        os.chmod(self.path("tokens"), 0o600)
        self.failed("gateway", "--http", "127.0.0.1:0", "--tokens", "tokens", says="line 1")
        self.failed("gateway", "--http", "127.0.0.1:0", "--cert", "no.pem", "--key", "no.key", says="no.pem")
        self.failed("gateway", "--http", "127.0.0.1:0", "--otlp", "https://collector", says="http://HOST:PORT")
        taken = f"127.0.0.1:{self.start().port}"
        done = self.run_in("gateway", "--http", taken)
        self.assertEqual((done.code, done.out), (1, ""))
        self.assertIn(f"cles: cannot listen at http://{taken}: Address already in use\n", done.err)  # besides its log


if __name__ == "__main__":
    unittest.main()
