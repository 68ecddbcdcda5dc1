# SPDX-License-Identifier: BSL-1.0
"""A nats-server for a measurement, which says what it has carried."""

import json
import sys
import tempfile
import urllib.request
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "scripts"))
from nats_server import NatsServer


class MeasuredServer(NatsServer):
    def __init__(self):
        self.folder = tempfile.TemporaryDirectory(prefix="cles-nats-")
        super().__init__(self.folder.name, "http: '127.0.0.1:-1'")

    def counted(self):
        """Messages and bytes that it has received and sent."""
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port_for('http monitor')}/varz", timeout=10) as answer:
            found = json.load(answer)
        return {key: found[key] for key in ("in_msgs", "in_bytes", "out_msgs", "out_bytes")}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()
        self.folder.cleanup()
