# SPDX-License-Identifier: BSL-1.0
"""Runs the script of a section, shows its progress, and determines the outcome."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict, dataclass

RAN, FAILED, SKIPPED, KEPT = "ran", "failed", "skipped", "kept"
GRACE_S = 15  # for cleaning up after SIGTERM
NOTHING_TO_MEASURE = 77  # a script's exit code, as in other test harnesses


@dataclass
class Outcome:
    state: str
    reason: str = ""
    seconds: float = 0.0

    as_json = asdict


class Progress:
    """Lines on stderr that begin with the time since the start; on a terminal each replaces the previous one."""

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
    """Returns the outcome. Afterwards the output file exists if, and only if, the script wrote JSON, even if it failed."""
    if not os.path.exists(script):
        return Outcome(SKIPPED, f"there is no {script}")
    if os.path.exists(output):
        os.remove(output)
    begun = time.monotonic()
    try:
        words = [sys.executable, "-B", script, *(["--quick"] if quick else []), *_programs(script, programs), "-o", output]
        code, last_lines = _watch(words, limit_s, progress)
    except (OSError, subprocess.SubprocessError) as failure:
        return Outcome(FAILED, f"{script} cannot be run: {failure}")
    return _judge(script, output, code, last_lines, limit_s, round(time.monotonic() - begun, 1))


def _programs(script, programs):
    """The option for the folder of the programs, if the script has it."""
    helped = subprocess.run([sys.executable, "-B", script, "--help"], capture_output=True, text=True, timeout=30, check=False)
    return ["--programs", programs] if "--programs" in helped.stdout else []


def _watch(words, limit_s, progress):
    """Its exit code, or None if it had to be stopped; and the last lines that it printed."""
    # A process group of its own, so that what it started can be ended with it.
    process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                               start_new_session=True)
    last_lines, part, deadline = [], b"", time.monotonic() + limit_s
    try:
        os.set_blocking(process.stdout.fileno(), False)
        while True:
            ended = process.poll() is not None  # before reading, so that nothing is left unread
            read = process.stdout.read()
            if read:
                *lines, part = (part + read).replace(b"\r", b"\n").split(b"\n")
                for line in filter(str.strip, (each.decode(errors="replace") for each in lines)):
                    last_lines = [*last_lines[-19:], line]
                    progress.update(line)
            elif ended:
                last = part.decode(errors="replace").strip()
                if last:
                    last_lines = [*last_lines, last]
                    progress.update(last)
                return process.returncode, last_lines
            elif time.monotonic() > deadline:
                return None, last_lines
            else:
                time.sleep(0.05)  # does not wait for the end of the pipe, which a remaining process may hold open
    finally:
        _end(process)


def _end(process):
    """Ends the script and everything that it started, first by SIGTERM, then by SIGKILL."""
    _signal_group(process.pid, signal.SIGTERM)
    deadline = time.monotonic() + GRACE_S
    while _signal_group(process.pid, 0) and time.monotonic() < deadline:
        process.poll()  # a group exists until its last member has been waited for
        time.sleep(0.02)
    _signal_group(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()


def _signal_group(group, number):
    """Whether the group has members."""
    try:
        os.killpg(group, number)
        return True
    except ProcessLookupError:
        return False


def _judge(script, output, code, last_lines, limit_s, seconds):
    try:
        with open(output, encoding="utf-8") as file:
            complete = isinstance(json.load(file), dict)
    except (OSError, ValueError):
        complete = False
    if not complete and os.path.exists(output):
        os.remove(output)
    last = last_lines[-1].strip() if last_lines else "no output"
    if code is None:
        return Outcome(FAILED, f"stopped after {limit_s:.0f} s; last: {last}", seconds)
    if code == NOTHING_TO_MEASURE:
        return Outcome(SKIPPED, last, seconds)
    if code != 0:
        return Outcome(FAILED, f"{script} ended with {code}: {last}", seconds)
    if not complete:
        return Outcome(FAILED, f"{script} wrote no JSON: {last}", seconds)
    return Outcome(RAN, "", seconds)
