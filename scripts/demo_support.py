# SPDX-License-Identifier: BSL-1.0
"""Shared by the parts of the demonstration."""

import os
import socket
import sys
import time

BOLD, PLAIN = ("\033[1m", "\033[0m") if sys.stdout.isatty() and not os.environ.get("NO_COLOR") else ("", "")
PATIENCE = 30  # seconds; everything takes far less


class Trouble(Exception):
    """Something has not happened as it should."""


def heading(text):
    print(f"\n{BOLD}{text}{PLAIN}", flush=True)


def free_port():
    """An unused UDP port, for a multicast group of its own."""
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for_end(process, seconds):
    """Whether it ends within that time. `Popen.wait` would wait for ever: an interrupt during an earlier call may leave its
    lock held."""
    until = time.monotonic() + seconds
    while True:
        try:
            if os.waitpid(process.pid, os.WNOHANG)[0] == process.pid:
                return True
        except ChildProcessError:  # it has been waited for
            return True
        if time.monotonic() > until:
            return False
        time.sleep(0.01)


def end(process, seconds):
    """Waits that long for its end, and then kills it."""
    if not wait_for_end(process, seconds):
        process.kill()
        wait_for_end(process, PATIENCE)
