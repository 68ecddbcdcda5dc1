# SPDX-License-Identifier: BSL-1.0
"""A NATS server for a test, and a program that uses it without CLES."""

import json
import socket

import nats_server
from daemon import Folder
from support import PATIENCE


class NatsServer(nats_server.NatsServer):
    def __init__(self, more=""):
        self.folder = Folder()
        super().__init__(self.folder.path, more)

    @property
    def tls_url(self):
        return f"tls://127.0.0.1:{self.port}"

    def client(self, **options):
        return NatsClient(self.port, **options)

    def __exit__(self, *_):
        self.stop()
        self.folder.__exit__()


class NatsClient:
    """Publishes and subscribes, in the protocol of NATS."""

    def __init__(self, port, **options):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
        self.stream = self.socket.makefile("rb")
        self.info = json.loads(self.stream.readline().split(b" ", 1)[1])
        self._send("CONNECT " + json.dumps({"verbose": False, "headers": False, **options}))
        self.subscriptions = 0
        self.flush()

    def _send(self, line, payload=None):
        self.socket.sendall(line.encode() + b"\r\n" + (b"" if payload is None else payload + b"\r\n"))

    def subscribe(self, subject):
        self.subscriptions += 1
        self._send(f"SUB {subject} {self.subscriptions}")
        self.flush()

    def publish(self, subject, payload="", reply=""):
        data = payload if isinstance(payload, bytes) else payload.encode()
        self._send(f"PUB {subject} {reply} {len(data)}".replace("  ", " "), data)

    def flush(self):
        """Until the server has processed what was sent."""
        self._send("PING")
        while self.stream.readline().strip() != b"PONG":
            pass

    def read(self):
        """The next message: its subject and its text."""
        subject, _, data = self.read_bytes()
        return subject, data.decode()

    def read_bytes(self):
        """The next message: its subject, the one for replies, and its bytes."""
        while True:
            line = self.stream.readline().decode()
            if line.startswith("PING"):
                self._send("PONG")
            elif line.startswith("MSG"):
                parts = line.split()
                data = self.stream.read(int(parts[-1]) + 2)[:-2]
                return parts[1], parts[3] if len(parts) == 5 else "", data
            elif line.startswith("-ERR") or not line:
                raise AssertionError(line or "the server has closed the connection")

    def request(self, subject, payload=""):
        inbox = f"_INBOX.{id(self)}.{self.subscriptions}"
        self.subscribe(inbox)
        self.publish(subject, payload, inbox)
        return self.read()[1]

    def close(self):
        self.stream.close()
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
