#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Extracts the client from docs/write_your_own_client.md and runs it against a node.

    plain_client_test.py PAGE CLES
"""

import contextlib
import io
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

from page import blocks_of

BOUND = 40  # seconds, for all of it


def expect(holds: bool, what: str) -> None:
    if not holds:
        raise AssertionError(what)


def main(page: Path, cles: str) -> None:
    client_code, use_code = ["\n".join(b.lines) for b in blocks_of(page) if b.language == "python"]
    lines = [line for line in client_code.splitlines() if line.strip()]
    expect(len(lines) <= 45, f"the client has grown to {len(lines)} lines")

    node = subprocess.Popen([cles, "serve", "--name", "car1", "--listen", "tcp://127.0.0.1:0", "--rate", "50"],
                            stdout=subprocess.PIPE, text=True)
    watchdog = threading.Timer(BOUND, node.kill)
    watchdog.start()
    try:
        port = 0
        for line in node.stdout:
            if found := re.search(r"tcp://127\.0\.0\.1:(\d+)", line):
                port = int(found[1])
                break
        expect(port != 0, "the node did not say where it listens")

        names: dict = {}
        exec(client_code, names)

        # As on the page.
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(use_code.replace("25370", str(port)), names)
        told = said.getvalue().splitlines()
        print(said.getvalue(), end="")
        expect("'lat'" in told[0], "PULL: a localization")
        expect(told[1] == "{'text': 'hello'}", "PUSH: the body comes back")
        steps = [int(line.rstrip("%")) for line in told[2:] if line.endswith("%")]
        expect(steps and steps == sorted(steps) and steps[-1] <= 100, f"DELEGATE: progress {steps}")
        expect({"slept_ms": 200} == eval(told[2 + len(steps)]), "DELEGATE: its result")
        updates = [line.split() for line in told[3 + len(steps):]]
        expect(len(updates) == 3 and all(u[0] == "car1:localization" for u in updates), "BIND: three updates")
        expect(int(updates[0][1]) < int(updates[1][1]) < int(updates[2][1]), "BIND: in order")

        # Further statements of the page.
        car = names["Client"]("127.0.0.1", port)
        for noun, code in (("car1:nothing", "no_task"), ("car2:localization", "no_target")):
            try:
                car.ask("PULL", noun)
                raise AssertionError(f"{noun} was answered")
            except names["Failure"] as failure:
                expect(failure.body["error"] == code, f"{noun}: {failure}")
        try:
            car.ask("DELEGATE", "car1:sleep/60000", deadline=100)
            raise AssertionError("a minute passed")
        except names["Failure"] as failure:
            expect(failure.body["error"] == "deadline", f"deadline: {failure}")
    finally:
        watchdog.cancel()
        node.send_signal(signal.SIGTERM)
        ended = node.wait(10)
    expect(ended == 0, f"the node ended with {ended}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
