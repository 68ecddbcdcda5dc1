# SPDX-License-Identifier: BSL-1.0
"""Announces nodes that do not exist."""

import json
import random
import socket

GROUP = "239.255.25.37"


def group_socket():
    """A socket that sends to a group on loopback."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
    made.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
    made.bind(("127.0.0.1", 0))
    return made


class Announcer:
    """Announces nodes to a group on loopback, from its own port."""

    def __init__(self, port):
        self.to = (GROUP, port)
        self.socket = group_socket()
        self.seq = 0

    def say(self, node, url, epoch, digest="", interval_ms=1000, **more):
        self.seq += 1
        said = {"node": node, "endpoints": [url], "interval_ms": interval_ms, "tasks": digest, **more}
        self.socket.sendto(f"UPDATE {node}:cles seq={self.seq} epoch={epoch:08x} {json.dumps(said)}\n".encode(), self.to)

    def send(self, line):
        self.socket.sendto(line.encode() + b"\n", self.to)

    def close(self):
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class Fakes(Announcer):
    """Many nodes of one closed port, each with a digest of its own."""

    def __init__(self, port, count):
        super().__init__(port)
        self.closed = socket.socket()  # bound, but not listening
        self.closed.bind(("127.0.0.1", 0))
        self.url = f"tcp://127.0.0.1:{self.closed.getsockname()[1]}"
        draw = random.Random(4711)
        self.nodes = [(f"fake{i:04}", draw.getrandbits(32)) for i in range(count)]

    def announce(self, nodes=None):
        for name, epoch in nodes or self.nodes:
            self.say(name, self.url, epoch, digest=f"{epoch:016x}", interval_ms=60000)

    def close(self):
        super().close()
        self.closed.close()
