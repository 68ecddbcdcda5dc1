# SPDX-License-Identifier: BSL-1.0
"""A nats-server on loopback, for the demonstration, tests and measurements."""

import re
import shutil
import subprocess
import time
from pathlib import Path

PROGRAM = shutil.which("nats-server") or shutil.which("nats-server", path="/usr/sbin:/usr/local/sbin")
MISSING = "nats-server is missing: scripts/setup installs it"
PATIENCE = 30  # seconds


def begin_quietly(*command):
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


class NatsServer:
    """Can be stopped and started again at the same port. `more` is added to its configuration."""

    def __init__(self, folder, more="", begin=begin_quietly):
        self.config, self.log = Path(folder, "nats.conf"), Path(folder, "nats.log")
        self.more, self.begin = more, begin
        self.port = -1  # any
        self.start()

    def start(self):
        self.config.write_text(f"host: 127.0.0.1\nport: {self.port}\n{self.more}\n", encoding="utf-8")
        self.log.write_text("", encoding="utf-8")
        self.process = self.begin(PROGRAM, "-c", str(self.config), "-l", str(self.log))
        end = time.monotonic() + PATIENCE
        while "Server is ready" not in (text := self.log.read_text(encoding="utf-8")):
            if time.monotonic() > end:
                raise TimeoutError(f"nats-server did not start: {text}")
            time.sleep(0.01)
        self.port = self.port_for("client connections")

    def port_for(self, what):
        return int(re.search(what + r" on 127\.0\.0\.1:(\d+)", self.log.read_text(encoding="utf-8"))[1])

    def stop(self):
        self.process.kill()
        self.process.wait()

    @property
    def url(self):
        return f"nats://127.0.0.1:{self.port}"
