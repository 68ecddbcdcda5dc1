# SPDX-License-Identifier: BSL-1.0
"""What the tests of the `cles` command share: running it, a node to talk to, a scripted node, a terminal."""

import json
import os
import pty
import re
import select
import shutil
import signal
import socket
import subprocess
import tempfile
import termios
import threading
import time
import unittest

CLES = os.environ.get("CLES_COMMAND", "cles")
# Built with libsodium, which keys, fleet and access need.
HAS_SECURITY = os.environ.get("CLES_SECURITY", "1") != ""
# Sanitizers and busy machines are slow; everything here is quick unless it hangs.
PATIENCE = float(os.environ.get("CLES_TEST_PATIENCE", "30"))


def environment(**more):
    """The environment for a command, without the variables of the tester's own."""
    env = {k: v for k, v in os.environ.items() if k not in ("CLES_AT", "CLES_KEYS", "CLES_POOL", "NO_COLOR")}
    env["TERM"] = "xterm"
    env["CLES_MULTICAST"] = "off"  # unless a test needs it
    env["CLES_CONTEXT"] = ""  # not that of the tester
    env.update(more)
    return env


def cles(*arguments, stdin=None, env=None):
    """Runs the command to its end; returns exit code, stdout, stderr."""
    done = subprocess.run([CLES, *arguments], input=stdin if stdin is not None else "", capture_output=True, text=True,
                          env=env or environment(), timeout=PATIENCE, check=False)
    return done.returncode, done.stdout, done.stderr


def start(*arguments, **options):
    """Starts the command with both streams piped."""
    options.setdefault("stdout", subprocess.PIPE)
    options.setdefault("stderr", subprocess.PIPE)
    options.setdefault("env", environment())
    return subprocess.Popen([CLES, *arguments], stdin=subprocess.DEVNULL, text=True, **options)


def read_line(process, stream=None):
    """The next line of a process's output, or a failure if none arrives. Bypasses Python's buffer, which would prevent
    waiting for further lines."""
    stream = stream or process.stdout
    line = b""
    end = time.monotonic() + PATIENCE
    while not line.endswith(b"\n"):
        ready, _, _ = select.select([stream], [], [], max(0, end - time.monotonic()))
        if not ready:
            process.kill()
            process.communicate()
            raise AssertionError(f"no line came, but {line!r}")
        byte = os.read(stream.fileno(), 1)
        if not byte:
            break
        line += byte
    return line.decode()


def finish(process):
    """Waits for the end; returns exit code and the rest of both streams."""
    try:
        out, err = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
        raise AssertionError(f"did not end; stdout {out!r}, stderr {err!r}") from None
    return process.returncode, out, err


def inherited_descriptors(pid):
    """What a program that the process starts would inherit, besides the standard streams: all descriptors without
    close-on-exec."""
    found = []
    for entry in sorted(os.listdir(f"/proc/{pid}/fd"), key=int):
        try:
            target = os.readlink(f"/proc/{pid}/fd/{entry}")
            with open(f"/proc/{pid}/fdinfo/{entry}", encoding="utf-8") as info:
                flags = next(int(line.split()[1], 8) for line in info if line.startswith("flags:"))
        except FileNotFoundError:  # closed meanwhile
            continue
        if int(entry) > 2 and not flags & os.O_CLOEXEC:
            found.append(f"{entry} {target}")
    return found


def free_port():
    """An unused UDP port, for a separate multicast group of the test."""
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_until(condition, what):
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError(f"waited in vain: {what}")


class Node:
    """A `cles serve` on a free port and a Unix socket."""

    def __init__(self, *arguments):
        self.folder = tempfile.mkdtemp(prefix="cles-")
        self.path = os.path.join(self.folder, "node.sock")
        self.log = open(os.path.join(self.folder, "log"), "w+", encoding="utf-8")
        self.process = start("serve", "--listen", "tcp://127.0.0.1:0", "--listen", f"unix://{self.path}", *arguments,
                             stderr=self.log)
        self.lines = [read_line(self.process), read_line(self.process)]
        if not all(self.lines):
            raise AssertionError(f"the node did not start: {self.errors()}")
        self.url = re.search(r"tcp://\S+", self.lines[0]).group(0)
        self.unix = f"unix://{self.path}"
        self.port = int(self.url.rsplit(":", 1)[1])

    def errors(self):
        self.log.flush()
        with open(self.log.name, encoding="utf-8") as log:
            return log.read()

    def connect(self):
        s = socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE)
        return s, s.makefile("r", encoding="utf-8", newline="\n")

    def ask(self, line):
        """Sends one line and returns one line, over a plain socket."""
        s, answers = self.connect()
        with s, answers:
            s.sendall(line.encode() + b"\n")
            return answers.readline().rstrip("\n")

    def stop(self, signal_number=signal.SIGTERM):
        if self.process.poll() is None:
            self.process.send_signal(signal_number)
        try:
            return finish(self.process)[0]
        finally:
            self.log.close()
            shutil.rmtree(self.folder)


class NodeTest(unittest.TestCase):
    """Tests that communicate with one node."""

    ARGUMENTS = ()

    @classmethod
    def setUpClass(cls):
        cls.node = Node(*cls.ARGUMENTS)

    @classmethod
    def tearDownClass(cls):
        code = cls.node.stop()
        if code != 0:
            raise AssertionError(f"the node ended with {code}")

    def run_at(self, *arguments, **options):
        return cles(*arguments, "--at", self.node.url, **options)

    def run_ok(self, *arguments, **options):
        code, out, err = self.run_at(*arguments, **options)
        self.assertEqual((code, err), (0, ""), out)
        return out

    def run_json(self, *arguments, **options):
        return json.loads(self.run_ok(*arguments, **options))


class ScriptedNode:
    """A node that follows a script: `answer(line, send)` is called for each line that one client sends."""

    def __init__(self, answer):
        self.answer = answer
        self.lines = []
        self.closed = threading.Event()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"tcp://127.0.0.1:{self.listener.getsockname()[1]}"
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def serve(self):
        try:
            client, _ = self.listener.accept()
        except OSError:
            return
        with client:
            try:
                for line in client.makefile("r", encoding="utf-8", newline="\n"):
                    self.lines.append(line.rstrip("\n"))
                    if self.answer(self.lines[-1], lambda text: client.sendall(text.encode() + b"\n")) == "close":
                        client.shutdown(socket.SHUT_RDWR)
                        break
            except OSError:
                pass
        self.closed.set()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.listener.close()
        self.thread.join(PATIENCE)


def id_of(line):
    """The `id=...` of a request line, followed by a space if present."""
    found = re.search(r" (id=\d+)", line)
    return found.group(1) + " " if found else ""


def on_terminal(*arguments, env=None, interrupt_after=None, keys=b"\x03", columns=None, program=CLES):
    """Runs the command on a separate terminal; returns exit code and everything it showed. After it has shown
    `interrupt_after`, the keys are pressed."""
    pid, terminal = pty.fork()
    if pid == 0:
        if columns is not None:
            termios.tcsetwinsize(1, (24, columns))
        os.execve(shutil.which(program) or program, [program, *arguments], env or environment())
    shown = b""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        ready, _, _ = select.select([terminal], [], [], 0.1)
        if ready:
            try:
                data = os.read(terminal, 65536)
            except OSError:  # the other side is closed
                break
            if not data:
                break
            shown += data
        if interrupt_after is not None and interrupt_after in shown:
            interrupt_after = None
            os.write(terminal, keys)
    else:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        raise AssertionError(f"did not end; showed {shown!r}")
    _, status = os.waitpid(pid, 0)
    os.close(terminal)
    return os.waitstatus_to_exitcode(status), shown.decode()
