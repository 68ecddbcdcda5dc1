# SPDX-License-Identifier: BSL-1.0
"""What the tests of `clesd` with security share: a fleet, and its daemons."""

import json
import os
import re
import signal
import socket
import subprocess

from daemon import CLESD, Folder, clean_environment, show_report
from support import CLES, PATIENCE, finish, free_port, read_line, wait_until


def cles(*arguments, env=None):
    done = subprocess.run([CLES, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          env=env or clean_environment(CLES_MULTICAST="off"), timeout=PATIENCE, check=False)
    return done.returncode, done.stdout, done.stderr


class Fleet(Folder):
    """The directories of a fleet's authority and of its nodes."""

    def __init__(self, *names):
        super().__init__()
        self.authority = self.file("fleet")
        self.run("fleet", "init", self.authority, "--with", ",".join(names))
        self.group = f"lo,239.255.0.7:{free_port()}"

    def run(self, *arguments):
        code, out, err = cles(*arguments)
        if code != 0:
            raise AssertionError(f"{arguments} ended with {code}: {err}")
        return out

    def keys(self, name):
        return os.path.join(self.authority, name)

    def let_forward(self, *names, who="*"):
        """They may forward for these members; `spread` follows."""
        for name in names:
            self.run("fleet", "rights", name, "--forwards", who, "--keys", self.authority)

    def spread(self, *names):
        """Gives the newest roster to nodes, as an operator does."""
        for name in names:
            self.run("keys", "join", os.path.join(self.authority, "roster"), "--keys", self.keys(name))

    def rule(self, name, text):
        """Replaces the local rules of a node."""
        path = os.path.join(self.keys(name), "rules")
        with open(path + ".new", "w", encoding="utf-8") as out:
            out.write(text)
        os.rename(path + ".new", path)


class Node:
    """A running clesd of the fleet."""

    def __init__(self, fleet, name, more="", program=CLESD, level="info", **how):
        self.log_file = fleet.file(f"{name}.log")
        self.socket = fleet.file(f"{name}.sock")
        users = f"security:\n  keys: {fleet.keys(name)}\n{more}"
        config = fleet.write(f"listen: ['tls://127.0.0.1:0', 'unix://{self.socket}']\nworkers: 1\n"
                             f"log: {{level: {level}, format: json}}\n{users}", f"{name}.yaml")
        with open(self.log_file, "w", encoding="utf-8") as log:
            self.process = subprocess.Popen([program, "--config", config, "-m", fleet.group], stdin=subprocess.DEVNULL,
                                            stdout=subprocess.PIPE, stderr=log, text=True, env=clean_environment(),
                                            **how)
        line = read_line(self.process)
        found = re.fullmatch(rf"{name} listening on (tls://127\.0\.0\.1:\d+)\n", line)
        if not found:
            self.process.kill()
            raise AssertionError(f"it said {line!r}, and logged {self.messages()}")
        self.url = found[1]
        wait_until(lambda: os.path.exists(self.socket), "its Unix socket exists")

    def messages(self):
        with open(self.log_file, encoding="utf-8") as log:
            return [json.loads(line)["message"] if line.startswith("{") else line  # `clesd` before it can log
                    for line in log if line.endswith("\n")]

    def ask(self, line):
        with socket.socket(socket.AF_UNIX) as link:
            link.settimeout(PATIENCE)
            link.connect(self.socket)
            link.sendall(line.encode() + b"\n")
            with link.makefile("r", encoding="utf-8") as replies:
                return replies.readline()

    def peers(self):
        """The live ones, by the name."""
        reply = self.ask("PULL self:cles/peers")
        return {node["node"] for node in json.loads(reply)["peers"] if node["state"] == "live"}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        finish(self.process)
        show_report(self.log_file)
