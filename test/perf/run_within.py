# SPDX-License-Identifier: BSL-1.0
"""Runs a program that starts others, with a time limit."""

import subprocess

GRACE_S = 60  # for ending what it has started


def run_within(limit_s, words, **options):
    """What subprocess.run returns, as text. After the limit the program gets SIGTERM, so that it can end what it started."""
    with subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          **options) as process:
        try:
            out, err = process.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            process.terminate()
            try:
                _, err = process.communicate(timeout=GRACE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
            raise AssertionError(f"{words} did not end in {limit_s} s, and has said:\n{err}") from None
    return subprocess.CompletedProcess(words, process.returncode, out, err)
