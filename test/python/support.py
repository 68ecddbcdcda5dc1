# SPDX-License-Identifier: BSL-1.0
"""What the tests of the Python package share."""

import asyncio
import os
import select
import signal
import socket
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

PATIENCE = float(os.environ.get("CLES_TEST_PATIENCE", "30"))


class AsyncTest(unittest.IsolatedAsyncioTestCase):
    """Each test has a folder of its own, and ends within `PATIENCE`."""

    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="cles")
        self.addCleanup(scratch.cleanup)
        self.scratch = Path(scratch.name)

    def _callTestMethod(self, method):
        async def in_time():
            asyncio.get_running_loop().set_debug(False)  # which unittest has switched on, and which is slow
            await asyncio.wait_for(method(), PATIENCE)

        super()._callTestMethod(in_time if asyncio.iscoroutinefunction(method) else method)

    async def until(self, condition, what="it did not happen"):
        end = time.monotonic() + PATIENCE / 2
        while not condition():
            self.assertLess(time.monotonic(), end, what)
            await asyncio.sleep(0.005)

    async def raw(self, url):
        """A client of plain lines, as a person with netcat is."""
        scheme, _, rest = url.partition("://")
        if scheme == "unix":
            reader, writer = await asyncio.open_unix_connection("\0" + rest[1:] if rest.startswith("@") else rest, limit=1 << 22)
        else:
            host, _, port = rest.rpartition(":")
            reader, writer = await asyncio.open_connection(host, int(port), limit=1 << 22)
        raw = Raw(reader, writer)
        self.addCleanup(writer.close)
        return raw


class Raw:
    def __init__(self, reader, writer):
        self.reader = reader
        self.writer = writer

    def send(self, *lines):
        self.writer.write("".join(f"{line}\n" for line in lines).encode())

    async def line(self):
        return (await self.reader.readline()).decode().removesuffix("\n")

    async def ask(self, line):
        self.send(line)
        return await self.line()

    async def rest(self):
        return (await self.reader.read()).decode()


# --- The programs ------------------------------------------------------------------------------------------------------

CLES = os.environ.get("CLES_COMMAND", "cles")
CLESD = os.environ.get("CLESD", "clesd")


def environment(**more):
    env = {key: value for key, value in os.environ.items() if not key.startswith("CLES_") or key in ("CLES_TEST_PATIENCE",)}
    return {**env, "CLES_MULTICAST": "off", **more}


async def cles(*arguments, stdin=""):
    """Runs the `cles` command to its end; returns exit code, stdout, stderr."""
    process = await asyncio.create_subprocess_exec(CLES, *arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                                   stderr=subprocess.PIPE, env=environment())
    out, err = await asyncio.wait_for(process.communicate(stdin.encode()), PATIENCE)
    return process.returncode, out.decode(), err.decode()


def start(test, *command):
    """Starts a program until the end of the test; returns it when it has printed that it listens."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env=environment())

    def stop():
        process.send_signal(signal.SIGTERM)
        try:
            process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()

    test.addCleanup(stop)
    end = time.monotonic() + PATIENCE
    line = b""
    while not line.endswith(b"\n"):
        ready, _, _ = select.select([process.stdout], [], [], max(0, end - time.monotonic()))
        byte = os.read(process.stdout.fileno(), 1) if ready else b""
        if not byte:
            raise AssertionError(f"{command}: {line!r}, {process.poll()}")
        line += byte
    return process, line.decode().strip()


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
