# SPDX-License-Identifier: BSL-1.0
"""A nats-server on loopback for a measurement, which can be killed and started again at the same port."""

import json
import re
import shutil
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path

PROGRAM = shutil.which("nats-server") or shutil.which("nats-server", path="/usr/sbin:/usr/local/sbin")
MISSING = "nats-server is missing: scripts/setup installs it"


class NatsServer:
    def __init__(self):
        self.folder = tempfile.TemporaryDirectory(prefix="cles-nats-")
        self.log = Path(self.folder.name, "log")
        self.ports = {"client": -1, "monitor": -1}  # any
        self.start()

    def start(self):
        self.log.write_text("", encoding="utf-8")
        self.process = subprocess.Popen(
            [PROGRAM, "-a", "127.0.0.1", "-p", str(self.ports["client"]), "-m", str(self.ports["monitor"]), "-l", str(self.log)],
            stdin=subprocess.DEVNULL)
        end = time.monotonic() + 10
        while "Server is ready" not in (text := self.log.read_text(encoding="utf-8")):
            if time.monotonic() > end:
                raise RuntimeError(f"the server did not start: {text}")
            time.sleep(0.01)
        for name, words in (("client", "client connections on"), ("monitor", "http monitor on")):
            self.ports[name] = int(re.search(words + r" 127\.0\.0\.1:(\d+)", text)[1])

    def kill(self):
        self.process.kill()
        self.process.wait()

    @property
    def url(self):
        return f"nats://127.0.0.1:{self.ports['client']}"

    def counted(self):
        """Messages and bytes that it has received and sent."""
        with urllib.request.urlopen(f"http://127.0.0.1:{self.ports['monitor']}/varz", timeout=10) as answer:
            found = json.load(answer)
        return {key: found[key] for key in ("in_msgs", "in_bytes", "out_msgs", "out_bytes")}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.kill()
        self.folder.cleanup()
