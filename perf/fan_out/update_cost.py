#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Counts the instructions that a subscriber executes for each update, with valgrind's callgrind, in user space.

    update_cost.py [PROGRAM] [--most N]      PROGRAM: build/release/perf/cles_update_cost; fails beyond N instructions in batches

A publisher of a few lines sends as many updates as the link takes. The difference between two numbers of updates leaves out what
is done once. Reading the values is counted apart, and subtracted.
"""

import argparse
import re
import socket
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

FEW, MANY = 20_000, 60_000
STYLES = ("coroutine", "callback", "batch")
FORMS = ("raw", "typed")


class Publisher:
    """Accepts one link, grants its BIND, and sends all lines when it gets a PUSH."""

    def __init__(self, lines: bytes):
        self.lines = lines
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    @property
    def url(self) -> str:
        return f"tcp://127.0.0.1:{self.listener.getsockname()[1]}"

    def serve(self) -> None:
        link, _ = self.listener.accept()
        with link, link.makefile("rb") as asked:
            for line in asked:
                head = re.match(rb"(\w+) \S+ .*\bid=(\d+)", line)
                if head is None:
                    continue
                if head[1] == b"PULL":
                    link.sendall(b'id=%b {"error":"no_task","message":"no PULL"}\n' % head[2])
                    continue
                link.sendall(b"id=%b {}\n" % head[2])
                if head[1] == b"BIND":
                    continue
                try:
                    link.sendall(self.lines)
                    link.recv(1)  # until the subscriber ends
                except ConnectionError:
                    pass
                return

    def end(self) -> None:
        self.listener.close()
        self.thread.join(10)


def instructions(*command: str) -> int:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "counts"
        subprocess.run(["valgrind", "--tool=callgrind", "--quiet", f"--callgrind-out-file={out}", *command], check=True)
        return int(re.search(r"^(?:summary|totals): (\d+)", out.read_text(encoding="utf-8"), re.MULTILINE)[1])


def per_update(count) -> float:
    """Of what `count` measures for a number of updates."""
    return (count(MANY) - count(FEW)) / (MANY - FEW)


def received(program: str, style: str, form: str, lines: list[bytes]) -> float:
    def count(updates: int) -> int:
        publisher = Publisher(b"".join(lines[:updates]))
        try:
            return instructions(program, publisher.url, str(updates), style, form)
        finally:
            publisher.end()

    return per_update(count)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("program", nargs="?", default="build/release/perf/cles_update_cost")
    parser.add_argument("--most", type=float)
    options = parser.parse_args()
    lines = subprocess.run([options.program, "print", str(MANY)], check=True, capture_output=True).stdout.splitlines(True)
    reading = {form: per_update(lambda n, form=form: instructions(options.program, "read", str(n), form)) for form in FORMS}

    print("instructions per update  all  reading its value  besides")
    failed = False
    for form in FORMS:
        for style in STYLES:
            whole = received(options.program, style, form, lines)
            besides = whole - reading[form]
            print(f"{form:<6}{style:<18}{whole:>5.0f}{reading[form]:>19.0f}{besides:>9.0f}", flush=True)
            failed |= options.most is not None and style == "batch" and besides > options.most
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
