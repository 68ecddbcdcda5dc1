# SPDX-License-Identifier: BSL-1.0
"""Shared by the parts of the demonstration."""

import os
import socket
import sys

BOLD, PLAIN = ("\033[1m", "\033[0m") if sys.stdout.isatty() and not os.environ.get("NO_COLOR") else ("", "")


class Trouble(Exception):
    """Something has not happened as it should."""


def heading(text):
    print(f"\n{BOLD}{text}{PLAIN}", flush=True)


def free_port():
    """An unused UDP port, for a multicast group of its own."""
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
