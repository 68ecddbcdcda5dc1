#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Bridges and the security of their NATS server: TLS, tokens, credentials, and permissions."""

import json
import os
import re
import signal
import socket
import ssl
import time
import unittest
from pathlib import Path

from bridges import BridgesTest, pool_of
from certificates import OPENSSL, Authority
from daemon import DEFAULTS, body, clean_environment, clesd
from nats_accounts import Account, Operator, User
from nats_server import MISSING, PROGRAM
from support import PATIENCE, wait_until

REFUSED = "cannot connect to NATS: "
CONNECTED = "connected to NATS, as a bridge of the pool"


class SecuredBridgesTest(BridgesTest):
    def bridge(self, name, pool, server, federation="", url=None, env=None):
        return self.node(name, pool, server, federation=federation, has_work=False, url=url, env=env)

    def assert_reach_each_other(self, hub, gate):
        """`hub` of the pool south, `gate` of north."""
        self.wait_for_pools(hub, gate)
        self.assertIn("seconds", json.loads(hub.ask("PULL north.gate:utc")))
        self.assertIn("seconds", json.loads(gate.ask("PULL south.hub:utc")))

    def assert_refused(self, node, words):
        """It logs why, once however often it tries, and `cles doctor` says the same."""
        entry = node.wait_for_entry(REFUSED)
        self.assertEqual(entry["level"], "warning")
        self.assertRegex(entry["message"], words)
        self.assertTrue(entry["message"].endswith(" (trying again)"), entry)
        self.assertFalse(pool_of(node)["connected"])
        (verdict, text), = self.diagnosis(node)
        self.assertEqual(verdict, "failure")
        self.assertRegex(text, f"is not connected to NATS: .*{words}")
        # It serves its own pool meanwhile.
        self.assertIn("seconds", json.loads(node.ask("PULL self:utc")))

    def replace(self, name, text):
        """Replaces a file at once, so that none reads a part of it."""
        os.replace(self.folder.write(text, f"{name}.new"), self.folder.file(name))


def all_of(peer):
    """What it sends until it ends the connection."""
    received = b""
    try:
        while more := peer.recv(65536):
            received += more
    except ConnectionResetError:
        pass
    return received


class FakeServer:
    """Listens, and says what a NATS server says first."""

    def __init__(self):
        self.socket = socket.create_server(("127.0.0.1", 0))

    def url(self, scheme):
        return f"{scheme}://127.0.0.1:{self.socket.getsockname()[1]}"

    def accept(self, tls_required=True):
        self.socket.settimeout(PATIENCE)
        peer, _ = self.socket.accept()
        peer.settimeout(PATIENCE)
        info = {"server_id": "fake", "version": "2.9.0", "max_payload": 1 << 20, "tls_required": tls_required}
        peer.sendall(f"INFO {json.dumps(info)}\r\n".encode())
        return peer

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()


class TlsPeer:
    """A server's end of TLS, whose records can be sent in parts."""

    def __init__(self, peer, certificate, key):
        self.peer, self.received, self.to_send = peer, ssl.MemoryBIO(), ssl.MemoryBIO()
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(certificate, key)
        self.tls = context.wrap_bio(self.received, self.to_send, server_side=True)
        self._complete(self.tls.do_handshake)
        self.unread = b""

    def _complete(self, step):
        while True:
            try:
                done = step()
                self.peer.sendall(self.to_send.read())
                return done
            except ssl.SSLWantReadError:
                self.peer.sendall(self.to_send.read())
                self._receive()

    def _receive(self):
        data = self.peer.recv(65536)
        if not data:
            raise AssertionError(f"it has closed the connection, after {self.unread!r}")
        self.received.write(data)

    def read_until(self, words, times=1):
        """What it says, up to these words."""
        while self.unread.count(words) < times:
            self.unread += self._complete(lambda: self.tls.read(65536))
        end = 0
        for _ in range(times):
            end = self.unread.index(words, end) + len(words)
        read, self.unread = self.unread[:end], self.unread[end:]
        return read

    def record(self, text):
        self.tls.write(text)
        return self.to_send.read()


class Tls(SecuredBridgesTest):
    def setUp(self):
        super().setUp()
        self.authority, self.other = Authority(self.folder, "authority"), Authority(self.folder, "other")

    def tls_server(self, more="", names="IP:127.0.0.1", tls=""):
        certificate, key = self.authority.issue("server", names)
        return self.server(f"tls {{cert_file: '{certificate}', key_file: '{key}', {tls}}}\n{more}")

    def test_an_authority(self):
        server = self.tls_server()
        trusted = f", tls: {{ca: {self.authority.certificate}}}"
        hub = self.bridge("hub", "south", server, trusted, url=server.tls_url)
        gate = self.bridge("gate", "north", server, trusted)  # which requires TLS, whatever the URL
        self.assert_reach_each_other(hub, gate)
        (verdict, _), = self.diagnosis(hub)
        self.assertEqual(verdict, "ok")

    def test_the_authorities_of_the_system(self):
        server = self.tls_server()
        trusted = clean_environment(SSL_CERT_FILE=self.authority.certificate)
        hub = self.bridge("hub", "south", server, url=server.tls_url, env=trusted)
        gate = self.bridge("gate", "north", server, url=server.tls_url, env=trusted)
        self.assert_reach_each_other(hub, gate)
        # The server demands TLS, whatever the URL.
        stranger = self.bridge("stranger", "west", server)
        self.assert_refused(stranger, "certificate")
        # `ca` replaces them.
        strict = self.bridge("strict", "west", server, f", tls: {{ca: {self.other.certificate}}}", env=trusted)
        self.assert_refused(strict, "certificate")

    def test_another_authority(self):
        server = self.tls_server()
        self.folder.write(Path(self.other.certificate).read_text(), "trusted.pem")
        trusted = f", tls: {{ca: {self.folder.file('trusted.pem')}}}"
        hub = self.bridge("hub", "south", server, f", tls: {{ca: {self.authority.certificate}}}", url=server.tls_url)
        gate = self.bridge("gate", "north", server, trusted, url=server.tls_url)
        self.assert_refused(gate, "certificate verify failed|unable to get local issuer certificate")
        # The file is read at each attempt: one that is no certificate, none, and the right one.
        self.replace("trusted.pem", "no certificate\n")
        gate.wait_for_entry("Error loading trusted certificates")
        os.remove(self.folder.file("trusted.pem"))
        gate.wait_for_entry(f"cannot read {self.folder.file('trusted.pem')}: No such file")
        self.replace("trusted.pem", Path(self.authority.certificate).read_text())
        self.assert_reach_each_other(hub, gate)

    def test_a_certificate_of_another_host(self):
        server = self.tls_server(names="DNS:broker.example,IP:127.0.0.2")
        hub = self.bridge("hub", "south", server, f", tls: {{ca: {self.authority.certificate}}}", url=server.tls_url)
        self.assert_refused(hub, "(IP address|hostname) mismatch")

    def test_a_certificate_for_a_name(self):
        server = self.tls_server(names="DNS:localhost")
        trusted = f", tls: {{ca: {self.authority.certificate}}}"
        url = f"tls://localhost:{server.port}"
        hub, gate = (self.bridge(name, pool, server, trusted, url=url) for name, pool in (("hub", "south"), ("gate", "north")))
        self.assert_reach_each_other(hub, gate)

    def test_a_server_without_tls_gets_no_token(self):
        token = self.folder.write("secret\n", "token")
        for name, scheme, more in (("hub", "tls", ""), ("gate", "nats", f", tls: {{ca: {self.authority.certificate}}}")):
            with FakeServer() as server:
                node = self.bridge(name, "south", server, f", token: {token}{more}", url=server.url(scheme))
                with server.accept(tls_required=False) as peer:
                    self.assertEqual(all_of(peer), b"")
                self.assert_refused(node, "Secure Connection")

    def test_a_client_certificate(self):
        server = self.tls_server(tls=f"ca_file: '{self.authority.certificate}', verify: true")
        files = {}
        for name, issuer in (("hub", self.authority), ("gate", self.other)):
            certificate, key = issuer.issue(name)
            files[name] = f", tls: {{ca: {self.authority.certificate}, certificate: {certificate}, key: {key}}}"
        hub = self.bridge("hub", "south", server, files["hub"], url=server.tls_url)
        hub.wait_for_entry(CONNECTED)
        without = self.bridge("without", "west", server, f", tls: {{ca: {self.authority.certificate}}}", url=server.tls_url)
        self.assert_refused(without, "certificate")
        gate = self.bridge("gate", "north", server, files["gate"], url=server.tls_url)
        self.assert_refused(gate, "certificate")
        # Its certificate and key are replaced, one after the other: in between, they do not match.
        certificate, key = self.authority.issue("gate")
        os.replace(certificate, self.folder.file("other-gate.pem"))
        gate.wait_for_entry("key values mismatch")
        os.replace(key, self.folder.file("other-gate.key"))
        self.assert_reach_each_other(hub, gate)

    def test_a_server_that_hangs(self):
        """While more waits for it than the system buffers."""
        server = self.tls_server()
        hub, gate = (self.bridge(name, pool, server, f", tls: {{ca: {self.authority.certificate}}}", url=server.tls_url)
                     for name, pool in (("hub", "south"), ("gate", "north")))
        self.assert_reach_each_other(hub, gate)
        server.process.send_signal(signal.SIGSTOP)
        try:
            with hub.connect() as link:
                filler = json.dumps({"x": "x" * 60_000})
                for number in range(1, 401):
                    link.send(f'PUSH north.gate:utc id={number} {filler}')
                self.assertLessEqual({body(link.read())["error"] for _ in range(400)}, {"unavailable", "busy"})
            hub.wait_for_entry("the connection to NATS was lost")
            hub.wait_for_entry(REFUSED)
            code, took = hub.stop()
            self.assertEqual(code, 0)
            self.assertLess(took, 3 + PATIENCE / 10)
        finally:
            server.process.send_signal(signal.SIGCONT)

    def test_a_server_that_hangs_before_tls(self):
        with FakeServer() as server:
            hub = self.bridge("hub", "south", server, url=server.url("tls"))
            with server.accept():
                self.assert_refused(hub, "the server does not answer")
                code, took = hub.stop()
            self.assertEqual(code, 0)
            self.assertLess(took, 3 + PATIENCE / 10)

    def test_a_part_of_a_record(self):
        """While the rest is on its way, the bridge goes on."""
        with FakeServer() as server:
            trusted = f", tls: {{ca: {self.authority.certificate}}}"
            hub = self.bridge("hub", "south", server, trusted, url=server.url("tls"))
            with server.accept() as peer:
                link = TlsPeer(peer, *self.authority.issue("server"))
                link.read_until(b"PING\r\n")
                peer.sendall(link.record(b"PONG\r\n"))
                link.read_until(b"PUB cles.south.beat.")
                record = link.record(b"PING\r\n")
                for part in (record[:3], record[3:20], record[20:]):
                    self.assertNotIn(b"PONG", link.read_until(b"PUB cles.south.beat.", times=2))
                    peer.sendall(part)
                link.read_until(b"PONG\r\n")
                # One that never comes.
                peer.sendall(link.record(b"PING\r\n")[:20])
                link.read_until(b"PUB cles.south.beat.", times=2)
                code, took = hub.stop()
            self.assertEqual(code, 0)
            self.assertLess(took, 1 + PATIENCE / 10)

    def test_much_crosses(self):
        server = self.tls_server()
        hub, gate = (self.bridge(name, pool, server, f", tls: {{ca: {self.authority.certificate}}}", url=server.tls_url)
                     for name, pool in (("hub", "south"), ("gate", "north")))
        self.assert_reach_each_other(hub, gate)
        filler = json.dumps({"x": "x" * 60_000})
        for node, other in ((hub, "north.gate"), (gate, "south.hub")):
            with node.connect() as link:
                for number in range(1, 101):
                    link.send(f"PUSH {other}:utc id={number} deadline=20000 {filler}")
                # Another node than this one says that it has no such task.
                self.assertEqual({body(link.read())["error"] for _ in range(100)} - {"busy"}, {"no_task"})
        self.assertEqual([pool_of(node)["connections"] for node in (hub, gate)], [1, 1])

    def test_a_certificate_without_its_key(self):
        for tls in ("certificate: /c.pem", "key: /k.pem", "ca: /a.pem, certificate: /c.pem"):
            file = self.folder.write(DEFAULTS + "insecure: true\nfederation: {nats: 'tls://h:4222', pool: north, "
                                     f"tls: {{{tls}}}}}\n")
            for check in ((), ("--check",)):
                code, _, errors = clesd("--config", file, *check)
                self.assertEqual(code, 2, errors)
                self.assertIn("federation.tls: has only one of 'certificate' and 'key'", errors)


class Tokens(SecuredBridgesTest):
    def setUp(self):
        super().setUp()
        self.secured = self.server('authorization { token: "secret" }')

    def test_the_right_one(self):
        hub = self.bridge("hub", "south", self.secured, f", token: {self.folder.write('secret', 'bare')}")
        with_newline = self.folder.write("secret\n", "with_newline")
        gate = self.bridge("gate", "north", self.secured, f", token: {with_newline}")
        self.assert_reach_each_other(hub, gate)

    def test_a_wrong_one(self):
        hub = self.bridge("hub", "south", self.secured, f", token: {self.folder.write('secret', 'right')}")
        gate = self.bridge("gate", "north", self.secured, f", token: {self.folder.write('guess', 'token')}")
        self.assert_refused(gate, "Authorization Violation")
        self.assertNotIn("guess", gate.log())
        self.replace("token", "secret\n")
        self.assert_reach_each_other(hub, gate)

    def test_no_file(self):
        hub = self.bridge("hub", "south", self.secured, f", token: {self.folder.write('secret', 'right')}")
        gate = self.bridge("gate", "north", self.secured, f", token: {self.folder.file('token')}")
        self.assert_refused(gate, f"cannot read {re.escape(self.folder.file('token'))}: No such file")
        self.replace("token", "\n")
        gate.wait_for_entry(f"cannot read a token from {self.folder.file('token')}: its first line is empty")
        self.replace("token", "secret")
        self.assert_reach_each_other(hub, gate)

    def test_none(self):
        hub = self.bridge("hub", "south", self.secured)
        self.assert_refused(hub, "Authorization Violation")


class Credentials(SecuredBridgesTest):
    def setUp(self):
        super().setUp()
        self.operator = Operator("operator")
        self.account, self.unknown = Account(self.operator, "fleet"), Account(self.operator, "unknown")
        self.apart = Account(self.operator, "apart")
        self.secured = self.server(self.operator.configuration(self.account, self.apart))

    def file(self, name, user):
        return f", credentials: {self.folder.write(user.credentials(), name)}"

    def pair(self, user):
        """`hub` with a user of the account, `gate` with this one."""
        return (self.bridge("hub", "south", self.secured, self.file("hub.creds", User(self.account, "hub"))),
                self.bridge("gate", "north", self.secured, self.file("gate.creds", user)))

    def test_the_right_ones(self):
        self.assert_reach_each_other(*self.pair(User(self.account, "gate")))

    def test_an_unknown_account(self):
        hub, gate = self.pair(User(self.unknown, "gate"))
        self.assert_refused(gate, "Authorization Violation")
        self.replace("gate.creds", User(self.account, "gate").credentials())
        self.assert_reach_each_other(hub, gate)

    def test_a_key_of_another_user(self):
        forged = User(self.account, "gate")
        forged.seed = User(self.account, "other").seed
        _, gate = self.pair(forged)
        self.assert_refused(gate, "Authorization Violation")

    def test_accounts_are_apart(self):
        hub, gate = self.pair(User(self.apart, "gate"))
        for node in (hub, gate):
            wait_until(lambda node=node: "round_trip_us" in pool_of(node), "its heartbeat has come back")
        wait_until(lambda: json.loads(hub.ask("PULL north.gate:utc"))["error"] == "no_target", "a pool no longer appears")
        self.assertEqual([pool_of(node)["pools"] for node in (hub, gate)], [0, 0])

    def test_expired_ones(self):
        hub, gate = self.pair(User(self.account, "gate", expires=time.time() - 60))
        self.assert_refused(gate, "Authorization Violation|Authentication Expired")
        self.replace("gate.creds", User(self.account, "gate").credentials())
        self.assert_reach_each_other(hub, gate)

    def test_ones_that_expire(self):
        hub, gate = self.pair(User(self.account, "gate", expires=time.time() + 3))
        self.assert_reach_each_other(hub, gate)
        gate.wait_for_entry("the connection to NATS was lost: User Authentication Expired")
        self.assert_refused(gate, "Authorization Violation|Authentication Expired")
        wait_until(lambda: pool_of(hub)["pools"] == 0, "the loss is noticed")
        self.replace("gate.creds", User(self.account, "gate").credentials())
        self.assert_reach_each_other(hub, gate)

    def test_no_file_and_a_file_without_credentials(self):
        hub, gate = self.pair(User(self.account, "gate"))
        self.assert_reach_each_other(hub, gate)
        missing = self.folder.file("missing.creds")
        west = self.bridge("west", "west", self.secured, f", credentials: {missing}")
        self.assert_refused(west, f"cannot read {re.escape(missing)}: No such file")
        user = User(self.account, "west")
        self.replace("missing.creds", user.jwt + "\n")
        west.wait_for_entry("no nkey user seed")
        self.replace("missing.creds", user.credentials())
        self.wait_for_pools(hub, gate, west)


class Permissions(SecuredBridgesTest):
    def test_the_example_of_the_page(self):
        page = (Path(__file__).parents[3] / "docs" / "federation.md").read_text()
        example = re.search(r"```\n(authorization \{.*?\n\})\n```", page, re.DOTALL)[1].replace("password: ...", "password: p")
        user = re.search(r"\{user: north.*\}\}", example, re.DOTALL)[0]
        # The same with the pools exchanged, and what north may ask: nothing to ask north for.
        other = user.replace("north", "west").replace("south", "north").replace("west", "south")
        server = self.server(example.replace(user, f"{user}\n{other}"))
        hub, gate = (self.bridge(name, pool, server, url=f"nats://{pool}:p@127.0.0.1:{server.port}")
                     for name, pool in (("hub", "south"), ("gate", "north")))
        self.assert_reach_each_other(hub, gate)
        with gate.connect() as link:
            for verb in ("PUSH", "DELEGATE", "BIND"):
                self.assertEqual(body(link.ask(f"{verb} south.hub:utc id=1"))["error"], "unavailable")
                gate.wait_for_entry(f'Permissions Violation for Publish to "cles.south.{verb.lower()}.hub.utc"')
        self.assert_reach_each_other(hub, gate)
        self.assertEqual([verdict for verdict, _ in self.diagnosis(gate)], ["warning", "ok"])

    def test_a_subject_that_is_missing(self):
        server = self.server('''authorization { users: [
            {user: all, password: p, permissions: {subscribe: "cles.>", publish: "cles.>"}}
            {user: some, password: p, permissions: {
                subscribe: {allow: "cles.>", deny: "cles.north.push.*.*"}
                publish: {allow: "cles.>", deny: "cles.*.pull.*.processes"}}}] }''')
        hub, gate = (self.bridge(name, pool, server, url=f"nats://{user}:p@127.0.0.1:{server.port}")
                     for name, pool, user in (("hub", "south", "all"), ("gate", "north", "some")))
        entry = gate.wait_for_entry('NATS: Permissions Violation for Subscription to "cles.north.push.*.*"')
        self.assertEqual(entry["level"], "warning")
        self.assert_reach_each_other(hub, gate)
        self.assertEqual(json.loads(hub.ask("PUSH north.gate:utc"))["error"], "unavailable")
        self.assertEqual(json.loads(gate.ask("PULL south.hub:processes"))["error"], "unavailable")
        gate.wait_for_entry('NATS: Permissions Violation for Publish to "cles.south.pull.hub.processes"')
        self.assert_reach_each_other(hub, gate)
        (verdict, text), (rest, _) = self.diagnosis(gate)
        self.assertEqual((verdict, rest), ("warning", "ok"))
        self.assertIn("Permissions Violation", text)
        self.assertEqual(pool_of(gate)["connections"], 1)


if __name__ == "__main__":
    if PROGRAM is None:
        raise SystemExit(MISSING)
    if OPENSSL is None:
        raise SystemExit("openssl is missing: scripts/setup installs it")
    unittest.main()
