#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""PULL through two bridges against two bare programs of libnats, through one nats-server, which this starts.

    measure.py PROGRAM [REQUESTS]        PROGRAM: cles_federation_cost
"""

import json
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MAX_LATENCY_RATIO = 1.8
MIN_RATE_RATIO = 0.5


def main(program: str, *arguments: str) -> int:
    server = shutil.which("nats-server") or shutil.which("nats-server", path="/usr/sbin:/usr/local/sbin")
    if server is None:
        print("nats-server is missing: scripts/setup installs it", file=sys.stderr)
        return 77
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "log")
        log.touch()
        with subprocess.Popen([server, "-a", "127.0.0.1", "-p", "-1", "-l", str(log)], stdin=subprocess.DEVNULL) as running:
            try:
                end = time.monotonic() + 10
                while "Server is ready" not in log.read_text(encoding="utf-8"):
                    if time.monotonic() > end:
                        raise RuntimeError("the server did not start")
                    time.sleep(0.01)
                port = re.search(r"client connections on 127\.0\.0\.1:(\d+)", log.read_text(encoding="utf-8"))[1]
                done = subprocess.run([program, f"nats://127.0.0.1:{port}", *arguments], stdout=subprocess.PIPE, text=True,
                                      check=True)
            finally:
                running.kill()
    found = json.loads(done.stdout)
    print(json.dumps(found))
    good = found["latency_ratio"] <= MAX_LATENCY_RATIO and found["rate_ratio"] >= MIN_RATE_RATIO
    print(f"latency {found['latency_ratio']} of the bare programs (at most {MAX_LATENCY_RATIO}), "
          f"rate {found['rate_ratio']} (at least {MIN_RATE_RATIO})")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
