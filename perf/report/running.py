# SPDX-License-Identifier: BSL-1.0
"""Runs one section's script, passes its progress on, and says what became of it."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict, dataclass

RAN, FAILED, SKIPPED, KEPT = "ran", "failed", "skipped", "kept"
GRACE_S = 15  # to clean up in, once told to stop
NOTHING_TO_MEASURE = 77  # a script's exit code, as in other test harnesses


@dataclass
class Outcome:
    state: str
    reason: str = ""
    seconds: float = 0.0

    as_json = asdict


class Progress:
    """Lines on stderr, each beginning with the time since the start of all; on a terminal they replace each other."""

    def __init__(self):
        self.start, self.on_terminal, self.open = time.monotonic(), sys.stderr.isatty(), False

    def elapsed(self):
        seconds = int(time.monotonic() - self.start)
        return f"[{seconds // 60:3}:{seconds % 60:02}] "

    def say(self, text):
        self._end_line()
        print(self.elapsed() + text, file=sys.stderr, flush=True)

    def update(self, text):
        if self.on_terminal:
            print(f"\r\033[K{self.elapsed()}  {text}", end="", file=sys.stderr, flush=True)
            self.open = True
        else:
            self.say("  " + text)

    def _end_line(self):
        if self.open:
            print(file=sys.stderr)
            self.open = False


def run(script, output, quick, programs, limit_s, progress):
    """The outcome. The output is there afterwards exactly where the script wrote JSON, even if it failed after that."""
    if not os.path.exists(script):
        return Outcome(SKIPPED, f"there is no {script}")
    if os.path.exists(output):
        os.remove(output)
    begun = time.monotonic()
    try:
        words = [sys.executable, "-B", script, *(["--quick"] if quick else []), *_programs(script, programs), "-o", output]
        code, told = _watch(words, limit_s, progress)
    except (OSError, subprocess.SubprocessError) as failure:
        return Outcome(FAILED, f"{script} cannot be run: {failure}")
    return _judge(script, output, code, told, limit_s, round(time.monotonic() - begun, 1))


def _programs(script, programs):
    """Where it finds programs, if it asks."""
    helped = subprocess.run([sys.executable, "-B", script, "--help"], capture_output=True, text=True, timeout=30, check=False)
    return ["--programs", programs] if "--programs" in helped.stdout else []


def _watch(words, limit_s, progress):
    """Its exit code, nothing where it had to be stopped; and the last lines that it printed."""
    # A group of its own, so that what it started ends with it.
    process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                               start_new_session=True)
    told, part, deadline = [], b"", time.monotonic() + limit_s
    try:
        os.set_blocking(process.stdout.fileno(), False)
        while True:
            ended = process.poll() is not None  # before reading, so that nothing is left unread
            read = process.stdout.read()
            if read:
                *lines, part = (part + read).replace(b"\r", b"\n").split(b"\n")
                for line in filter(str.strip, (each.decode(errors="replace") for each in lines)):
                    told = [*told[-19:], line]
                    progress.update(line)
            elif ended:
                last = part.decode(errors="replace").strip()
                if last:
                    told = [*told, last]
                    progress.update(last)
                return process.returncode, told
            elif time.monotonic() > deadline:
                return None, told
            else:
                time.sleep(0.05)  # no waiting for the pipe's end: what it left behind may hold that
    finally:
        _end(process)


def _end(process):
    """It and all that it started are told to end, and made to if they do not: also what it left behind when it ended."""
    _signal_group(process.pid, signal.SIGTERM)
    deadline = time.monotonic() + GRACE_S
    while _signal_group(process.pid, 0) and time.monotonic() < deadline:
        process.poll()  # a group is there until its last member has been waited for
        time.sleep(0.02)
    _signal_group(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()


def _signal_group(group, number):
    """Whether there is anybody in it."""
    try:
        os.killpg(group, number)
        return True
    except ProcessLookupError:
        return False


def _judge(script, output, code, told, limit_s, seconds):
    try:
        with open(output, encoding="utf-8") as file:
            complete = isinstance(json.load(file), dict)
    except (OSError, ValueError):
        complete = False
    if not complete and os.path.exists(output):
        os.remove(output)
    last = told[-1].strip() if told else "it said nothing"
    if code is None:
        return Outcome(FAILED, f"stopped after {limit_s:.0f} s; last: {last}", seconds)
    if code == NOTHING_TO_MEASURE:
        return Outcome(SKIPPED, last, seconds)
    if code != 0:
        return Outcome(FAILED, f"{script} ended with {code}: {last}", seconds)
    if not complete:
        return Outcome(FAILED, f"{script} wrote no JSON: {last}", seconds)
    return Outcome(RAN, "", seconds)
