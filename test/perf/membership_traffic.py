#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Security adds little to the traffic by which nodes know each other: bytes of a plain fleet and of a secured one, of
the same size, in the same time; in the multicast group, and by gossip.

    membership_traffic.py CLES CLESD ISOLATED

Each fleet runs in a network namespace of its own, by means of test/support/isolated. Skipped where the system permits
none, because other programs' bytes would be counted.
"""

import json
import os
import re
import select
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MAX_RATIO = 1.4  # signed announcements state their sources
NODES = 6
SETTLE_S = 8  # until each node has learnt of all others, and gossip has found its contacts
COUNT_S = 15
GROUP = ("239.255.25.37", 25370)
HEADERS = 28  # of IP and UDP


def start_nodes(kind, scheme, clesd, folder):
    listening = []
    nodes = []
    environment = {name: value for name, value in os.environ.items() if not name.startswith("CLES_")}
    empty = Path(folder, f"{kind}-{scheme}.yaml")
    empty.touch()  # so that a configuration of this host does not count
    for number in range(1, NODES + 1):
        words = [clesd, "--config", empty, "--log", "error", "--listen", f"{scheme}://127.0.0.1:{26000 + number}",
                 "--multicast", "lo" if kind == "group" else "off"]
        words += ["--keys", f"{folder}/fleet/car{number}"] if scheme == "tls" else ["--node", f"car{number}"]
        words += ["--seed", f"{scheme}://127.0.0.1:26001"] if kind == "gossip" else []
        node = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment)
        nodes.append(node)
        listening.append(node.stdout.readline())
    assert all(listening), listening
    return nodes


def datagrams_of_the_group(seconds):
    """The number of datagrams, and their bytes with headers."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        receiver.bind(GROUP)
        receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                            socket.inet_aton(GROUP[0]) + socket.inet_aton("127.0.0.1"))
        count = size = 0
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            if select.select([receiver], [], [], left)[0]:
                count += 1
                size += len(receiver.recv(65536)) + HEADERS
        return count, size


def packets_of_loopback(seconds):
    """The number of packets, and their bytes with all headers."""
    def counters():
        found = re.search(r"^\s*lo:\s*(\d+)\s+(\d+)", Path("/proc/net/dev").read_text(encoding="ascii"), re.MULTILINE)
        return int(found[1]), int(found[2])
    before = counters()
    time.sleep(seconds)
    after = counters()
    return after[1] - before[1], after[0] - before[0]


def measure(kind, scheme, clesd, folder):
    """In the namespace of the fleet: per node and second."""
    nodes = start_nodes(kind, scheme, clesd, folder)
    try:
        time.sleep(SETTLE_S)
        count, size = (datagrams_of_the_group if kind == "group" else packets_of_loopback)(COUNT_S)
        assert all(node.poll() is None for node in nodes), "a node has ended"
        print(json.dumps([count / NODES / COUNT_S, size / NODES / COUNT_S]))
    finally:
        for node in nodes:
            node.kill()
            node.wait()


def main(cles, clesd, isolated):
    own = os.readlink("/proc/self/ns/net")
    inside = subprocess.run([isolated, "readlink", "/proc/self/ns/net"], capture_output=True, text=True, check=True)
    if inside.stdout.strip() == own:
        print("skipped: the system permits no network namespace")
        return 77
    with tempfile.TemporaryDirectory() as folder:
        names = ",".join(f"car{number}" for number in range(1, NODES + 1))
        subprocess.run([cles, "fleet", "init", f"{folder}/fleet", "--with", names], capture_output=True, check=True)
        running = {(kind, scheme): subprocess.Popen(
            [isolated, sys.executable, "-B", __file__, kind, scheme, clesd, folder], stdout=subprocess.PIPE, text=True)
            for kind in ("group", "gossip") for scheme in ("tcp", "tls")}
        found = {which: process.communicate()[0] for which, process in running.items()}
    good = True
    for kind in ("group", "gossip"):
        (_, plain), (messages, secured) = (json.loads(found[kind, scheme]) for scheme in ("tcp", "tls"))
        ratio = secured / plain
        print(f"{kind}, {NODES} nodes: {plain:.0f} bytes a second and node, secured {secured:.0f}: {ratio:.2f}; "
              f"permitted {MAX_RATIO}")
        good = good and messages > 1 and ratio <= MAX_RATIO
    return 0 if good else 1


if __name__ == "__main__":
    if len(sys.argv) == 5:
        measure(*sys.argv[1:])
    else:
        sys.exit(main(*sys.argv[1:]))
