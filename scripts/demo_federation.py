#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Demonstrates two pools that are joined by a NATS server: three daemons, of which two are bridges. Requests cross by name,
for any node and for all nodes; then the server is killed and started again.

    demo_federation.py [FOLDER]

FOLDER contains `clesd` and `cles`; default build/release/apps. Without `nats-server`, it says so, and ends. No processes
or files are left behind.
"""

import json
import subprocess
import sys
import time

from demo_cluster import Cluster, Link, patient, run, show
from demo_support import PATIENCE, Trouble, heading
from nats_server import PROGRAM, NatsServer

HUB, GATE, INNER = "hub", "gate", "car1"
CONFIG = """\
node: {name}
listen: [tcp://127.0.0.1:0]
multicast: off
workers: 2
{place}
plugins: [{plugins}]
"""


class TwoPools(Cluster):
    """hub is the only node of south; gate and car1 are of north. hub and gate are bridges."""

    server = None

    def start_server(self):
        if self.server is None:
            self.server = NatsServer(self.folder, begin=self.begin)
        else:
            self.server.start()

    def config_of(self, name):
        bridge = f"insecure: true\nfederation: {{nats: '{self.server.url}', pool: %s}}"
        place = {HUB: bridge % "south", GATE: bridge % "north",
                 INNER: f"pool: north\nseeds: ['{self.urls.get(GATE, '')}']"}[name]
        return CONFIG.format(name=name, place=place, plugins="libcles-system.so" if name == HUB else
                             "libcles-system.so, libcles-primes.so")


def ask(link, line):
    answer = link.ask(line)
    show(f"> {line}\n< {json.dumps(answer, separators=(',', ':'))}")
    return answer


def expect(holds, answer):
    if not holds:
        raise Trouble(f"unexpected: {answer}")


def show_demo(pools):
    heading("Two pools, joined by nats-server")
    begun = time.monotonic()
    pools.start_server()
    for name in (HUB, GATE, INNER):
        pools.start(name)
    with Link(pools.urls[HUB]) as link:
        patient(lambda: "error" not in link.ask(f"PULL {INNER}:prime/97"), f"{HUB} reaches {INNER}")
        show(f"After {time.monotonic() - begun:.1f} s, {HUB} of the pool south reaches {INNER} of the pool north. "
             f"The configuration of {HUB}:")
        for line in pools.config_of(HUB).splitlines():
            show(f"    {line}")
        heading(f"Requests that cross NATS, asked at {HUB}")
        answer = ask(link, f"PULL north.{INNER}:prime/97")
        expect(answer == {"value": True}, answer)
        answer = ask(link, "DELEGATE any:primes {\"below\":100000}")  # nobody in south offers it
        expect(answer.get("count") == 9592, answer)
        answer = ask(link, "PULL all:prime/7")
        expect(set(answer["results"]) == {f"north.{GATE}", f"north.{INNER}"} and not answer["errors"], answer)
        heading("The other pools: cles ls --pools")
        show(run_cles(pools, "ls", "--pools", "-o", "table"))

        heading("kill -9 for nats-server")
        pools.server.stop()
        patient(lambda: link.ask(f"PULL north.{INNER}:prime/97").get("error") == "unavailable", "the loss is noticed")
        answer = ask(link, f"PULL north.{INNER}:prime/97")
        answer = ask(link, f"PULL {HUB}:prime/97")
        expect(answer["error"] == "no_task", answer)
        show(f"{HUB} serves its own pool meanwhile.")
        begun = time.monotonic()
        pools.start_server()
        patient(lambda: "error" not in link.ask(f"PULL north.{INNER}:prime/97"), f"{HUB} reaches {INNER} again")
        show(f"{time.monotonic() - begun:.1f} s after the server was started again, requests cross it.")


def run_cles(pools, *arguments):
    running = pools.begin("cles", *arguments, "--at", pools.urls[HUB], stderr=subprocess.PIPE)
    out, err = running.communicate(timeout=PATIENCE)
    if running.returncode != 0:
        raise Trouble(f"cles {' '.join(arguments)} ended with {running.returncode}: {err.decode()}")
    return out.decode()


def main():
    if PROGRAM is None:
        heading("Two pools, joined by nats-server")
        show("nats-server is not installed, so this part is left out: scripts/setup installs it.")
        return 0
    return run(show_demo, TwoPools(sys.argv[1] if len(sys.argv) > 1 else "build/release/apps"))


if __name__ == "__main__":
    sys.exit(main())
