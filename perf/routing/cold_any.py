#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures how soon a daemon that has just been started answers its first `any:`.

    perf/routing/cold_any.py

Two daemons offer a task; a third, which offers nothing, is started and asked for it at once, by a link that is tried until
there is one. The time is from before the start of its process until the answer. By multicast on the loopback interface.
"""

import argparse
import pathlib
import socket
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "evaluation"))
from clean_environment import clean_environment  # noqa: E402

TIMEOUT_S = 30  # for what takes milliseconds


def free_port(kind):
    with socket.socket(type=kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Daemon:
    def __init__(self, programs, group_port, name, folder, offers):
        self.port = free_port(socket.SOCK_STREAM)
        plugin = f"plugins: [{{path: {programs}/plugins/libcles-system.so}}]\n" if offers else ""
        config = pathlib.Path(folder) / f"{name}.yaml"
        config.write_text(f"node: {name}\nlisten: tcp://127.0.0.1:{self.port}\n"
                          f"multicast: {{interface: lo, port: {group_port}}}\n{plugin}", encoding="utf-8")
        self.process = subprocess.Popen([f"{programs}/apps/clesd", "--config", str(config)], stdin=subprocess.DEVNULL,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=clean_environment())

    def ask(self, request):
        """The answer, as soon as there is a link."""
        end = time.monotonic() + TIMEOUT_S
        while True:
            try:
                link = socket.create_connection(("127.0.0.1", self.port), timeout=TIMEOUT_S)
                break
            except ConnectionRefusedError:
                if self.process.poll() is not None or time.monotonic() > end:
                    sys.exit(f"cold_any.py: no daemon at port {self.port}")
                time.sleep(0.001)
        with link, link.makefile("rw", encoding="utf-8", newline="\n") as lines:
            lines.write(request + "\n")
            lines.flush()
            return lines.readline()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = pathlib.Path(__file__).resolve().parents[2]
    parser.add_argument("--programs", default=root / "build/release", type=pathlib.Path, help="the build (build/release)")
    parser.add_argument("--rounds", default=15, type=int, help="daemons that are started (15)")
    given = parser.parse_args()
    if not (given.programs / "apps/clesd").exists():
        sys.exit(f"cold_any.py: there is no {given.programs}/apps/clesd")
    times = []
    with tempfile.TemporaryDirectory() as folder:
        group = free_port(socket.SOCK_DGRAM)
        with (Daemon(given.programs, group, "sat1", folder, True) as one,
              Daemon(given.programs, group, "sat2", folder, True) as two):
            one.ask("PULL self:utc")
            two.ask("PULL self:utc")
            for i in range(given.rounds):
                begun = time.monotonic()
                with Daemon(given.programs, group, f"cold{i}", folder, False) as cold:
                    answer = cold.ask("PULL any:utc")
                    times.append((time.monotonic() - begun) * 1000)
                if "error" in answer or not answer:
                    sys.exit(f"cold_any.py: the answer was {answer!r}")
    print(f"first any: of a cold node  {statistics.median(times):.0f} ms"
          f" ({min(times):.0f} to {max(times):.0f}, {len(times)} daemons)")


if __name__ == "__main__":
    main()
