# SPDX-License-Identifier: BSL-1.0
"""Shared by the tests of `clesd`: a daemon with its own configuration, and a client."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time

from support import PATIENCE, environment, finish, inherited_descriptors, read_line

CLESD = os.environ.get("CLESD", "clesd")
# Plugins with one fault each, and one whose tasks misbehave.
FAULTY = os.environ.get("FAULTY_PLUGINS", "")
STUBBORN = os.environ.get("STUBBORN_PLUGIN", "")
# A plugin to be isolated.
HOSTILE = os.environ.get("HOSTILE_PLUGIN", "")
# The folder of the installed plugins.
PLUGINS = os.environ.get("PLUGINS", "")

DEFAULTS = "node: sat1\nlisten: tcp://127.0.0.1:0\nmulticast: off\nworkers: 2\nlog: {level: debug, format: json}\n"


def clean_environment(**more):
    """An environment without variables for a daemon, and without a configuration in a default location."""
    env = {k: v for k, v in environment(XDG_CONFIG_HOME="/nowhere").items()
           if k not in ("CLES_NODE", "CLES_LISTEN", "CLES_SEEDS", "CLES_LOG", "CLES_CONFIG", "CLES_MULTICAST",
                        "NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID")}
    env.update(more)
    return env


def clesd(*arguments, env=None, cwd=None):
    """Runs it to its end; returns exit code, stdout, stderr."""
    done = subprocess.run([CLESD, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, cwd=cwd,
                          env=env or clean_environment(), timeout=PATIENCE, check=False)
    return done.returncode, done.stdout, done.stderr


class Folder:
    """A scratch folder with configuration files in it."""

    def __init__(self):
        self.path = tempfile.mkdtemp(prefix="clesd-")

    def file(self, name):
        return os.path.join(self.path, name)

    def write(self, text, name="clesd.yaml"):
        os.makedirs(os.path.dirname(self.file(name)), exist_ok=True)
        with open(self.file(name), "w", encoding="utf-8") as out:
            out.write(text)
        return self.file(name)

    def read(self, name):
        with open(self.file(name), encoding="utf-8") as file:
            return file.read()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        shutil.rmtree(self.path)


def show_report(path):
    """Prints a log that contains a sanitizer's report, which would be lost with the file."""
    with open(path, encoding="utf-8") as log:
        text = log.read()
    # What the plugin 'hostile' does to its process is meant to be reported.
    if any("Sanitizer" in line and '"hostile: ' not in line for line in text.splitlines()):
        print(text)


class Daemon(Folder):
    """A running clesd. Its log, JSON on stderr, is kept in a file."""

    def __init__(self, more="", base=DEFAULTS, env=None, arguments=()):
        super().__init__()
        self.config = self.write(base + more)
        with open(self.file("log"), "w", encoding="utf-8") as log:
            self.process = subprocess.Popen([CLESD, "--config", self.config, *arguments], stdin=subprocess.DEVNULL,
                                            stdout=subprocess.PIPE, stderr=log, text=True,
                                            env=env or clean_environment())
        line = read_line(self.process)
        found = re.match(r"(\S+) listening on (tcp://127\.0\.0\.1:(\d+))\n$", line)
        if not found:
            self.process.kill()
            self.process.communicate()
            raise AssertionError(f"it said {line!r}, and logged {self.log()!r}")
        self.url, self.port = found[2], int(found[3])

    def log(self):
        with open(self.file("log"), encoding="utf-8") as log:
            return log.read()

    def entries(self):
        """What it has logged so far; a last line that is still being written is left out."""
        return [json.loads(line) for line in self.log().splitlines(keepends=True) if line.endswith("\n")]

    def wait_for_entry(self, words):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            for entry in self.entries():
                if words in entry["message"]:
                    return entry
            time.sleep(0.01)
        raise AssertionError(f"it did not log {words!r}, but {self.log()!r}")

    def connect(self):
        return Link(self.port)

    def ask(self, line):
        with self.connect() as link:
            return link.ask(line)

    def inherited(self):
        return inherited_descriptors(self.process.pid)

    def send_signal(self, number):
        self.process.send_signal(number)

    def stop(self, number=signal.SIGTERM):
        """Its exit code, and how long it took to end."""
        begun = time.monotonic()
        if self.process.poll() is None:
            self.send_signal(number)
        return self.end(begun)

    def end(self, begun=None):
        """The same without a signal, because a second one would stop it at once."""
        begun = begun or time.monotonic()
        code, _, _ = finish(self.process)
        return code, time.monotonic() - begun

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()
        show_report(self.file("log"))
        super().__exit__()


class Link:
    """A client that sends and receives lines on one socket."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.lines = self.socket.makefile("r", encoding="utf-8", newline="\n")

    def send(self, line):
        self.socket.sendall(line.encode() + b"\n")

    def read(self):
        return self.lines.readline().rstrip("\n")

    def ask(self, line):
        self.send(line)
        return self.read()

    def close(self):
        self.lines.close()
        self.socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def body(reply):
    """The JSON of a reply, without its id."""
    return json.loads(reply[reply.index("{"):])


def wait_until_running(daemon, count):
    """Waits until so many jobs run."""
    with daemon.connect() as link:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            pool = json.loads(link.ask("PULL self:cles/metrics"))["pool"]
            if pool["running"] == count:
                return
            time.sleep(0.01)
    raise AssertionError(f"{count} jobs were to run; the pool says {pool}")
