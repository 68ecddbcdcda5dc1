#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Demonstrates security: two nodes of a fleet, a member that asks them, an outsider that may not, and a removal.

    demo_secured.py [FOLDER]

FOLDER contains the programs; default build/release/apps. No processes or files are left behind.
"""

import os
import re
import signal
import subprocess
import sys
import tempfile
import time

from demo_support import PATIENCE, Trouble, free_port, heading


class Fleet:
    """The nodes, and the folder with their files."""

    def __init__(self, programs, folder):
        self.cles = os.path.join(programs, "cles")
        self.folder = folder
        self.nodes = []
        # Without the user's settings for CLES, and without the other nodes of this host.
        self.environment = {k: v for k, v in os.environ.items() if not k.startswith("CLES_")}
        self.environment["CLES_MULTICAST"] = f"lo,239.255.25.37:{free_port()}"

    def run(self, *arguments):
        done = subprocess.run([self.cles, *arguments], cwd=self.folder, env=self.environment, capture_output=True,
                              stdin=subprocess.DEVNULL, text=True, timeout=PATIENCE, check=False)
        return done.returncode, done.stdout + ("" if done.returncode == 0 else done.stderr)

    def show(self, *arguments, code=0, says=""):
        """Runs it, and prints the command and what it prints."""
        ended, said = self.run(*arguments)
        print("  $ cles " + " ".join(arguments))
        for line in said.splitlines():
            print(f"    {line}", flush=True)
        if ended != code or says not in said:
            raise Trouble(f"that ended with {ended}, not with {code} and '{says}'")
        return said

    def wait_until(self, what, *arguments, code=0, says=""):
        until = time.monotonic() + PATIENCE
        while True:
            ended, said = self.run(*arguments)
            if ended == code and says in said:
                return
            if time.monotonic() > until:
                raise Trouble(f"timed out: {what}; the last answer was {said}")
            time.sleep(0.1)

    def start(self, name):
        """Starts a node at a free port; returns its URL."""
        with open(os.path.join(self.folder, name + ".log"), "w", encoding="utf-8") as log:
            node = subprocess.Popen([self.cles, "serve", "--keys", f"fleet/{name}", "--listen", "tls://127.0.0.1:0"],
                                    cwd=self.folder, env=self.environment, stdin=subprocess.DEVNULL,
                                    stdout=subprocess.PIPE, stderr=log, text=True)
        self.nodes.append(node)
        said = node.stdout.readline()
        found = re.search(r"listening on (tls://\S+)", said)
        if not found:
            with open(os.path.join(self.folder, name + ".log"), encoding="utf-8") as log:
                raise Trouble(f"{name} did not start: {log.read()}")
        print(f"  {said}", end="", flush=True)
        return found[1]

    def stop(self):
        for node in self.nodes:
            node.terminate()
        for node in self.nodes:
            node.communicate()


def demonstrate(fleet):
    heading("A fleet of three: cles fleet init")
    fleet.show("fleet", "init", "fleet", "--with", "car1,car2,sat1")
    urls = {name: fleet.start(name) for name in ("car1", "car2")}

    heading("sat1 finds car1 by its name, and asks it: authenticated, encrypted")
    fleet.show("pull", "car1:echo/hello", "--keys", "fleet/sat1", says='["hello"]')

    heading("An outsider, with the key of another fleet")
    fleet.run("fleet", "init", "others", "--with", "spy")
    fleet.show("pull", "self:echo/hello", "--at", urls["car1"], "--keys", "others/spy", code=1)

    heading("sat1 is removed: car1 gets the new roster, car2 gets it from car1")
    fleet.run("fleet", "remove", "sat1", "--keys", "fleet")
    fleet.run("keys", "join", "fleet/roster", "--keys", "fleet/car1")
    fleet.wait_until("car2 has the new roster", "pull", "self:cles", "--at", urls["car2"], "--keys", "fleet/car2",
                     says='"roster":3')
    for name in ("car1", "car2"):
        fleet.show("pull", "self:echo/hello", "--at", urls[name], "--keys", "fleet/sat1", code=1, says="refuses")


def main():
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))
    programs = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else "build/release/apps")
    with tempfile.TemporaryDirectory(prefix="cles-demo-") as folder:
        fleet = Fleet(programs, folder)
        try:
            demonstrate(fleet)
        except (Trouble, OSError, subprocess.TimeoutExpired) as failure:
            print(f"cles: {failure}", file=sys.stderr)
            return 1
        finally:
            fleet.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
