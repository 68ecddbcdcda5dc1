# SPDX-License-Identifier: BSL-1.0
"""What the tests of `cles doctor` share: hosts with what is to be found there."""

import json
import os
import subprocess
import tempfile
import unittest

from support import CLES, PATIENCE, environment, read_line
from two_hosts import Hosts

CLESD = os.environ.get("CLESD", "")

# Announces a node called ghost repeatedly, at a port of the loopback on which it listens itself if requested.
GHOST = """
import json, socket, sys, threading, time
answers, clock = sys.argv[1] == "answers", float(sys.argv[2])
server = socket.create_server(("127.0.0.1", 0))
port = server.getsockname()[1]
if not answers:
    server.close()

def serve():
    while True:
        client = server.accept()[0]
        threading.Thread(target=talk, args=(client,), daemon=True).start()

def talk(client):
    for line in client.makefile("r"):
        id = "".join(word + " " for word in line.split() if word.startswith("id="))
        if "self:utc" in line:
            reply = {"seconds": time.time() + clock}
        elif "peers" in line:
            reply = {"peers": []}
        else:
            reply = {"node": "ghost", "version": "1", "protocol": 1, "tasks": [{"verb": "PULL", "task": "utc"}]}
        client.sendall((id + json.dumps(reply) + "\\n").encode())

if answers:
    threading.Thread(target=serve, daemon=True).start()
sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sender.bind(("127.0.0.1", 0))
sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
print("up", flush=True)
seq = 0
while True:
    seq += 1
    body = json.dumps({"node": "ghost", "endpoints": [f"tcp://127.0.0.1:{port}"], "interval_ms": 1000})
    sender.sendto(f"UPDATE ghost:cles seq={seq} epoch=01020304 {body}".encode(), ("239.255.25.37", 25370))
    time.sleep(0.05)
"""

STRANGER = """
import socket, sys
if sys.argv[1] == "tcp":
    held = socket.create_server(("127.0.0.1", 25370))
else:
    held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    held.bind(("0.0.0.0", 25370))
print("up", flush=True)
import time
time.sleep(3600)
"""


class DoctorTest(unittest.TestCase):
    """Each test has two separate hosts, on which port 25370 is unused. `cles doctor` runs on the near one, unless the
    other is named."""

    def setUp(self):
        self.hosts = Hosts()
        self.addCleanup(self.hosts.close)
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.clesd("echo 'without a file: can be used'")

    def clesd(self, script):
        """What is found as clesd."""
        path = os.path.join(self.folder.name, "clesd")
        with open(path, "w", encoding="utf-8") as file:
            file.write(f"#!/bin/sh\n{script}\n")
        os.chmod(path, 0o755)

    def environment(self, **more):
        path = self.folder.name + os.pathsep + os.environ["PATH"]
        return environment(PATH=path, **{"CLES_MULTICAST": "lo", **more})

    def start(self, *command, wait_for="", host=None, **variables):
        process = subprocess.Popen([*self.hosts.inside(host or self.hosts.near), *command], stdin=subprocess.DEVNULL,
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                                   env=self.environment(**variables))
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        self.assertIn(wait_for, read_line(process))
        return process

    def serve(self, name, *arguments):
        return self.start(CLES, "serve", "--name", name, *arguments, wait_for="listening")

    def run_doctor(self, *arguments, host=None, limit="true", **variables):
        """`limit`: a command of the shell that runs before."""
        done = subprocess.run([*self.hosts.inside(host or self.hosts.near), "sh", "-c", f'{limit}; exec "$@"', "sh", CLES,
                               "doctor", *arguments], capture_output=True, text=True, stdin=subprocess.DEVNULL,
                              env=self.environment(**variables), timeout=PATIENCE, check=False)
        self.assertEqual(done.stderr, "")
        return done.returncode, done.stdout

    def examine(self, *arguments, **variables):
        """Exit code, and the findings of each check."""
        code, out = self.run_doctor("-o", "json", *arguments, **variables)
        report = json.loads(out)
        found = {}
        for each in report["findings"]:
            found.setdefault(each["check"], []).append(each)
        self.assertEqual(report["failures"], sum(e["verdict"] == "failure" for e in report["findings"]))
        self.assertEqual(report["warnings"], sum(e["verdict"] == "warning" for e in report["findings"]))
        self.assertEqual(code, 1 if report["failures"] else 0, out)
        return code, found

    def failure(self, found, check, says):
        """The only failure of a check, which contains this text."""
        failures = [each for each in found[check] if each["verdict"] == "failure"]
        self.assertEqual(len(failures), 1, found)
        self.assertRegex(failures[0]["text"], says)
        self.assertIn("advice", failures[0])
        return failures[0]
