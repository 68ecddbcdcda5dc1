#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Replaces netcat if it is not installed: sends its input, half-closes with -N, prints what it receives.

    netcat.py [-N] HOST PORT
    netcat.py [-N] -U PATH
"""

import shutil
import socket
import sys

options = [word for word in sys.argv[1:] if word.startswith("-")]
words = [word for word in sys.argv[1:] if not word.startswith("-")]
if any("U" in option for option in options):
    link = socket.socket(socket.AF_UNIX)
    link.connect(words[0])
else:
    link = socket.create_connection((words[0], int(words[1])))
link.sendall(sys.stdin.buffer.read())
if any("N" in option for option in options):
    link.shutdown(socket.SHUT_WR)
with link.makefile("rb") as answers:
    shutil.copyfileobj(answers, sys.stdout.buffer)
