#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Measures how strangers without a key delay the members of a fleet: members open links and sessions with a node while it is
flooded, and without that.

    perf/tls/floods.py [--build build/release] [--seconds 20] [--only NAME...] [--smoke]

- `connections`: 2,000 connections a second from 200 addresses, each with the beginning of a handshake of TLS; members open
  links of tls.
- `rosters`: 16 connections with an unknown key, which state a high version of the roster and send a part of a long one;
  members open links, and a member brings a newer roster, a hundred times.
- `hellos`, `hellos_with_mac`: 2,000 forged HELLO a second from 200 addresses, without and with a MAC; members open sessions
  by udp.

Twelve members begin twice a second each, as if they had just been started. Under each flood, 99 % must succeed, and their p99
must be at most twice that without it, plus 5 ms. The node has one core; members and strangers have another. Addresses are
those of loopback. The exit code is 1 if a figure is not met, except with `--smoke`: a short run that shows that it works.
"""

import argparse
import collections
import contextlib
import json
import os
import pathlib
import random
import resource
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "evaluation"))
from clean_environment import clean_environment  # noqa: E402

MEMBERS = 12
OTHERS = 150  # that make the roster long
ADDRESSES = [f"127.1.0.{i}" for i in range(1, 201)]
USUAL_RATE = 2000  # of what strangers send, a second
SMOKE_RATE = 200
TIMEOUT_S = 120


# --- The strangers, in a process of their own ---

class Counted:
    """How much a flood has sent, which it prints at its end."""

    def __init__(self, rate=0):
        self.rate, self.sent, self.begun = rate, 0, time.monotonic()
        signal.signal(signal.SIGTERM, self.end)

    def end(self, *_):
        print(json.dumps({"a_second": round(self.sent / (time.monotonic() - self.begun))}), flush=True)
        os._exit(0)

    def pace(self, step):
        """Calls `step` as often as it should, some times in a row."""
        while True:
            due = int((time.monotonic() - self.begun) * self.rate) - self.sent
            for _ in range(due):
                step()
                self.sent += 1
            time.sleep(0.002)


def stranger_context(certificate=None):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    context.set_alpn_protocols(["cles/1"])
    if certificate:
        context.load_cert_chain(certificate)
    return context


def flood_connections(at, rate, _):
    incoming, outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
    with contextlib.suppress(ssl.SSLWantReadError):
        stranger_context().wrap_bio(incoming, outgoing).do_handshake()
    client_hello = outgoing.read()
    opened = collections.deque()
    counted = Counted(rate)

    def step():
        link = socket.socket()
        link.setblocking(False)
        link.setsockopt(socket.IPPROTO_IP, 24, 1)  # IP_BIND_ADDRESS_NO_PORT
        link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        with contextlib.suppress(OSError):
            link.bind((random.choice(ADDRESSES), 0))
            link.connect_ex(at)  # on loopback, it is connected at once
            link.send(client_hello)
        opened.append(link)
        if len(opened) > rate:  # each stays for a second
            opened.popleft().close()

    counted.pace(step)


def flood_rosters(at, _, certificate):
    counted = Counted()
    context = stranger_context(certificate)

    def hold(address):
        while True:
            with contextlib.suppress(OSError), socket.create_connection(at, 5, (address, 0)) as plain, \
                    context.wrap_socket(plain) as link:
                link.sendall(b'PUSH self:cles/hello reply=no {"version":4294967295,"epoch":"0000beef"}\n'
                             b'PUSH self:cles/roster reply=no {"signature":"' + b"A" * 900_000)
                counted.sent += 1
                link.settimeout(30)
                while link.recv(4096):
                    pass

    for address in ADDRESSES[:16]:
        threading.Thread(target=hold, args=(address,), daemon=True).start()
    while True:
        time.sleep(1)


def flood_hellos(at, rate, size):
    sockets = []
    for address in ADDRESSES:
        sockets.append(socket.socket(type=socket.SOCK_DGRAM))
        sockets[-1].bind((address, 0))
    counted = Counted(rate)

    def step():
        head = b"\x81" + random.randrange(2, 2 + MEMBERS).to_bytes(3, "big")
        with contextlib.suppress(OSError):  # what does not fit is lost on its way
            random.choice(sockets).sendto(head + os.urandom(size - len(head)), at)

    counted.pace(step)


FLOODS = {"connections": flood_connections, "rosters": flood_rosters,
          "hellos": lambda at, rate, _: flood_hellos(at, rate, 100),
          "hellos_with_mac": lambda at, rate, _: flood_hellos(at, rate, 116)}


# --- The fleet ---

class Measured:
    def __init__(self, build, folder, rate):
        self.build, self.fleet, self.strangers, self.rate = build, folder / "fleet", folder / "strangers", rate
        cores = sorted(os.sched_getaffinity(0))
        self.near, self.far = (["taskset", "-c", str(core)] for core in (cores[-1], cores[0]))
        names = [f"m{i}" for i in range(MEMBERS)] + [f"x{i}" for i in range(OTHERS)]
        self.cles("fleet", "init", self.fleet, "--with", ",".join(["node", *names]))
        self.cles("fleet", "init", self.strangers, "--with", "stranger")
        self.cles("keys", "cert", "--keys", self.strangers / "stranger")
        self.node = subprocess.Popen([*self.far, f"{build}/apps/cles", "serve", "--name", "node", "--keys", self.fleet / "node",
                                      "--listen", "tls://127.0.0.1:0", "--listen", "udp://127.0.0.1:0", "--multicast", "off"],
                                     stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                                     env=clean_environment(), preexec_fn=permit_files)
        lines = [self.node.stdout.readline().split() for _ in range(2)]
        self.urls = {line[-1].partition(":")[0]: line[-1] for line in lines}

    def cles(self, *words):
        done = subprocess.run([f"{self.build}/apps/cles", *words], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              check=False, timeout=TIMEOUT_S, env=clean_environment())
        if done.returncode != 0:
            sys.exit(f"floods.py: {done.stderr.strip()}")

    def bring_newest(self, name):
        self.cles("keys", "join", self.fleet / "roster", "--keys", self.fleet / name)

    def members(self, by, seconds, members=MEMBERS):
        done = subprocess.run([*self.near, f"{self.build}/perf/tls/cles_member_links", self.fleet, str(members), self.urls[by],
                               str(seconds)], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
                              timeout=seconds + TIMEOUT_S, env=clean_environment())
        if done.returncode != 0:
            sys.exit(f"floods.py: {done.stderr.strip()}")
        return json.loads(done.stdout)

    def newcomers(self, count):
        """One member after another that brings a newer roster than the node has."""
        found = []
        for _ in range(count):
            self.cles("fleet", "rotate", "--keys", self.fleet)
            self.bring_newest("m0")
            found.append(self.members("tls", 0, 1))
        took = sorted(each["p99_ms"] for each in found)
        return {"begun": sum(each["begun"] for each in found), "succeeded": sum(each["succeeded"] for each in found),
                "p50_ms": took[len(took) // 2], "p99_ms": took[min(len(took) - 1, len(took) * 99 // 100)]}

    @contextlib.contextmanager
    def flood(self, kind, by):
        host, _, port = self.urls[by].partition("://")[2].rpartition(":")
        running = subprocess.Popen([*self.near, sys.executable, "-B", __file__, "--flood", kind, "--at", f"{host}:{port}",
                                    "--rate", str(self.rate), "--certificate", self.strangers / "stranger" / "tls.pem"], stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, text=True, preexec_fn=permit_files)
        try:
            time.sleep(1)  # it goes on for a while before anything is measured
            yield
            running.terminate()
            said = json.loads(running.communicate(timeout=TIMEOUT_S)[0])
            print(f"     strangers: {said['a_second']} a second", flush=True)
        finally:
            running.kill()
            running.wait()

    def close(self):
        self.node.kill()
        self.node.wait()


def permit_files():
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(20_000, most), most))


def reached(what, usual, flooded):
    share = flooded["succeeded"] / flooded["begun"]
    most = 2 * usual["p99_ms"] + 5
    good = share >= 0.99 and flooded["p99_ms"] <= most
    print(f"{'ok  ' if good else 'MISS'} {what}: {flooded['succeeded']} of {flooded['begun']} succeeded (at least 99 %), p50 "
          f"{flooded['p50_ms']:.2f} ms, p99 {flooded['p99_ms']:.2f} ms (at most {most:.2f}; without the flood "
          f"{usual['succeeded']} of {usual['begun']}, p50 {usual['p50_ms']:.2f}, p99 {usual['p99_ms']:.2f} ms)", flush=True)
    return good


def measure(options):
    good = True
    with tempfile.TemporaryDirectory(prefix="cles-floods-") as folder:
        fleet = Measured(options.build, pathlib.Path(folder), SMOKE_RATE if options.smoke else USUAL_RATE)
        try:
            newcomers = 2 if options.smoke else 100
            for kind in options.only:
                by = "udp" if kind.startswith("hellos") else "tls"
                usual = fleet.members(by, options.seconds)
                usual_newcomers = fleet.newcomers(newcomers) if kind == "rosters" else None
                with fleet.flood(kind, by):
                    flooded = fleet.members(by, options.seconds)
                    newer = fleet.newcomers(newcomers) if usual_newcomers else None
                good = reached(f"{kind}, members by {by}", usual, flooded) and good
                if newer:
                    good = reached(f"{kind}, members that bring a newer roster", usual_newcomers, newer) and good
        finally:
            fleet.close()
    return good


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=lambda text: pathlib.Path(text).resolve(), default="build/release")
    parser.add_argument("--seconds", type=int, default=20)
    parser.add_argument("--only", nargs="+", choices=FLOODS, default=list(FLOODS))
    parser.add_argument("--smoke", action="store_true")
    parser.add_argument("--flood", choices=FLOODS, help=argparse.SUPPRESS)
    parser.add_argument("--at", help=argparse.SUPPRESS)
    parser.add_argument("--rate", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--certificate", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.flood:
        host, _, port = options.at.rpartition(":")
        FLOODS[options.flood]((host, int(port)), options.rate, options.certificate)
    options.build = pathlib.Path(options.build).resolve()
    if options.smoke:
        options.seconds = 1
    return 0 if measure(options) or options.smoke else 1


if __name__ == "__main__":
    sys.exit(main())
