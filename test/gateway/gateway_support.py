# SPDX-License-Identifier: BSL-1.0
"""What the tests of the gateway share: a gateway, and clients of it."""

import http.client
import json
import os
import re
import signal
import socket
import tempfile
import threading
from collections import namedtuple

from support import PATIENCE, environment, finish, free_port, read_line, start

Reply = namedtuple("Reply", "status headers body")


class Gateway:
    """A `cles gateway` at a free port."""

    def __init__(self, *arguments, env=None, cwd=None):
        handle, self.log = tempfile.mkstemp(prefix="cles-gateway-")
        self.process = start("gateway", "--http", "127.0.0.1:0", *arguments, env=env or environment(), cwd=cwd, stderr=handle)
        os.close(handle)
        line = read_line(self.process)
        found = re.fullmatch(r"(\S+) listening on (https?)://127\.0\.0\.1:(\d+)\n", line)
        if not found:
            raise AssertionError(f"the gateway did not start: {line!r}, {self.errors()}")
        self.name, self.scheme, self.port = found[1], found[2], int(found[3])

    def errors(self):
        with open(self.log, encoding="utf-8") as log:
            return log.read()

    def connection(self):
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)

    def ask(self, method, path, body=None, **headers):
        """One request on a connection of its own. `_` in the name of a header is `-`; a body is sent as JSON."""
        connection = self.connection()
        try:
            send(connection, method, path, body, headers)
            response = connection.getresponse()
            return Reply(response.status, response.headers, response.read().decode())
        finally:
            connection.close()

    def get(self, path, **headers):
        return self.ask("GET", path, **headers)

    def post(self, path, body=None, **headers):
        return self.ask("POST", path, body, **headers)

    def raw(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE)

    def exchange(self, text):
        """Sends this, and reads until the gateway closes the connection."""
        with self.raw() as client:
            client.sendall(text.encode("latin-1"))
            return read_all(client)

    def counted(self, member):
        """One of its own counters."""
        return json.loads(self.get("/pull/self/cles/metrics").body)["gateway"][member]

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        try:
            return finish(self.process)[0]
        finally:
            os.unlink(self.log)


def send(connection, method, path, body, headers):
    fields = {name.replace("_", "-"): value for name, value in headers.items()}
    if body is not None:
        fields.setdefault("Content-Type", "application/json")
    connection.request(method, path, body, fields)


def read_all(client):
    data = b""
    while True:
        try:
            part = client.recv(65536)
        except ConnectionResetError:
            part = b""
        if not part:
            return data.decode("latin-1")
        data += part


class Events:
    """A stream of server-sent events."""

    def __init__(self, gateway, path, method="GET", connection=None, **headers):
        connection = connection or gateway.connection()
        send(connection, method, path, None, headers)
        self.response = connection.getresponse()
        self.status = self.response.status
        self.type = self.response.headers["Content-Type"]

    def next(self):
        """The next event, as (type, id, data), where data is read as JSON; None at the end. Comments are passed over."""
        kind, mark, data = "message", None, None
        while line := self.response.readline().decode():
            name, _, value = line.rstrip("\n").partition(": ")
            if name == "event":
                kind = value
            elif name == "id":
                mark = value
            elif name == "data":
                data = json.loads(value)
            elif line == "\n" and data is not None:
                return kind, mark, data
        return None

    def close(self):
        self.response.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class FakeNodes:
    """Nodes that are announced to the group of an environment. Each replies the same text to each request."""

    def __init__(self, env, names, text):
        self.reply = text.encode()
        self.listener = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self._accept, daemon=True).start()
        group, port = env["CLES_MULTICAST"].split(",")[1].split(":")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as announcer:
            announcer.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
            announcer.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
            url = f"tcp://127.0.0.1:{self.listener.getsockname()[1]}"
            for epoch, name in enumerate(names, 1):
                said = {"node": name, "endpoints": [url], "interval_ms": 60000, "tasks": ""}
                announcer.sendto(f"UPDATE {name}:cles seq=1 epoch={epoch:08x} {json.dumps(said)}\n".encode(), (group, int(port)))

    def _accept(self):
        while True:
            try:
                client, _ = self.listener.accept()
            except OSError:  # it is closed
                return
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client):
        with client, client.makefile("rb") as lines:
            for line in lines:
                if found := re.search(rb" id=(\d+)", line):
                    try:
                        client.sendall(b"id=" + found[1] + b" " + self.reply + b"\n")
                    except OSError:
                        return

    def close(self):
        self.listener.close()


def own_group():
    """The environment for nodes and a gateway that find each other, and no others."""
    return environment(CLES_MULTICAST=f"lo,239.255.0.9:{free_port()}")
