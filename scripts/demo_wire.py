#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Sends requests to two nodes over plain sockets, and prints each line that is sent (`>`) or received (`<`).

    demo_wire.py URL_OF_CAR1 URL_OF_CAR2
"""

import socket
import sys

from demo_support import PATIENCE, heading


class Wire:
    def __init__(self, url: str, sign: str = ""):
        scheme, _, rest = url.partition("://")
        if scheme == "unix":
            self.link = socket.socket(socket.AF_UNIX)
            self.link.settimeout(PATIENCE)
            self.link.connect(rest)
        else:
            host, _, port = rest.rpartition(":")
            self.link = socket.create_connection((host, int(port)), PATIENCE)
        self.lines = self.link.makefile("r", encoding="utf-8", newline="\n")
        self.sign = sign

    def send(self, line: str) -> None:
        print(f"  {self.sign}> {line}", flush=True)
        self.link.sendall(line.encode() + b"\n")

    def receive(self) -> str:
        line = self.lines.readline().rstrip("\n")
        if not line:
            raise ConnectionError("the node has closed the link")
        print(f"  {self.sign}< {line}", flush=True)
        return line

    def ask(self, line: str, begins: str) -> None:
        self.send(line)
        self.expect(begins)

    def expect(self, begins: str) -> None:
        line = self.receive()
        if not line.startswith(begins):
            raise ValueError(f"expected a line that begins with {begins}")


def show(url1: str, url2: str) -> None:
    car1, car2 = Wire(url1), Wire(url2)

    heading("PULL: get data once (car1 over TCP, then car2 over its Unix socket)")
    car1.ask("PULL car1:localization", '{"utc":')
    car2.ask("PULL car2:localization", '{"utc":')

    heading("PUSH: send parameters and data")
    car1.ask('PUSH car1:echo {"text":"road works ahead"}', '{"text":')

    heading("DELEGATE: delegate a task, with progress")
    car1.send("DELEGATE car1:sleep/600 id=7 progress=yes")
    while car1.receive().startswith("id=7 progress="):
        pass

    heading("BIND: subscribe to updates (on one link), and UPDATE: publish (on another)")
    subscriber, requester = Wire(url2, "subscriber "), Wire(url2, "requester  ")
    subscriber.ask("BIND car2:notice", "{}")
    requester.ask('UPDATE car2:notice {"text":"bridge closed"}', "{")
    subscriber.expect("UPDATE car2:notice seq=1 ")

    heading("Errors")
    car1.ask("PULL car1:speed", '{"error":"no_task"')
    car1.ask('PUSH car1:echo {"text":', '{"error":"bad_request"')


if __name__ == "__main__":
    try:
        show(sys.argv[1], sys.argv[2])
    except (OSError, ValueError) as problem:
        sys.exit(f"cles: {problem}")
