# SPDX-License-Identifier: BSL-1.0
"""A continuous stream of jobs, and the outcome of each."""

import collections
import json
import math
import select
import socket
import time

from support import PATIENCE

DEADLINE = PATIENCE / 15  # of a job; quick ones are far from it on any machine that can run the tests
SLACK = PATIENCE / 10  # what a busy machine may add to an asserted time

# The outcome of each code. If it is unknown, the work may have been done or not.
FATES = {None: "done", "busy": "refused", "unavailable": "unknown", "deadline": "unknown", "link lost": "unknown",
         "failed": "failed", "no_target": "failed", "no_task": "failed", "cancelled": "failed"}
# How often a job that may run only once has run, by its code.
RUNS = {None: {1}, "failed": {1}, "busy": {0}, "no_target": {0}, "no_task": {0}, "cancelled": {0, 1},
        "unavailable": {0, 1}, "deadline": {0, 1}, "link lost": {0, 1}}


class Job:
    def __init__(self, number, target, task):
        self.number, self.target, self.task = number, target, task
        self.sent = time.monotonic()
        self.ended = None
        self.code = None  # of its failure

    @property
    def lost(self):
        return self.ended is not None and FATES[self.code] == "unknown"

    def __repr__(self):
        return f"{self.target}:{self.task}/{self.number} {self.code or 'done'}"


class Load:
    """A client that sends jobs at a steady pace, without waiting for their answers."""

    PACE = 0.005
    LIMIT = math.inf  # jobs under way: a machine that does not keep up gets them more slowly
    # The kinds of requests, in turn: most are for any node; the others name each node in turn.
    MIX = (("any", "once"), ("any", "again"), ("named", "once"), ("any", "once"), ("any", "fails"), ("any", "once"))

    def __init__(self, daemon, names):
        self.names = names
        self.jobs = []
        self.flying = {}  # by id
        self.next_due = time.monotonic()
        self.connect(daemon)

    def connect(self, daemon):
        self.socket = socket.create_connection(("127.0.0.1", daemon.port), timeout=PATIENCE)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.rest = b""
        self.linked = True
        self.left = False  # the node has announced that it leaves

    # -- sending -----------------------------------------------------------------------------------------------------

    def send(self, target, task, work_ms=2, deadline=DEADLINE):
        job = self.prepare(target, task)
        self.write([self.line(job, work_ms, deadline)])
        return job

    def burst(self, target, count, work_ms):
        jobs = [self.prepare(target, "once") for _ in range(count)]
        self.write([self.line(job, work_ms, DEADLINE) for job in jobs])
        return jobs

    def prepare(self, target, task):
        job = Job(len(self.jobs) + 1, target, task)
        self.jobs.append(job)
        self.flying[job.number] = job
        return job

    def line(self, job, work_ms, deadline):
        return (f"DELEGATE {job.target}:{job.task}/{job.number}/{work_ms} id={job.number} "
                f"deadline={int(deadline * 1000)}\n")

    def write(self, lines):
        try:
            self.socket.sendall("".join(lines).encode())
        except (BrokenPipeError, ConnectionResetError):
            pass  # reading returns the rest

    def send_next(self):
        turn = len(self.jobs)
        target, task = self.MIX[turn % len(self.MIX)]
        self.send(self.names[turn // len(self.MIX) % len(self.names)] if target == "named" else target, task)

    # -- receiving ---------------------------------------------------------------------------------------------------

    def hear(self, wait):
        ready, _, _ = select.select([self.socket], [], [], max(0.0, wait))
        if not ready:
            return
        try:
            data = self.socket.recv(1 << 16)
        except ConnectionResetError:
            data = b""
        if not data:
            self.lose_link()
            return
        *lines, self.rest = (self.rest + data).split(b"\n")
        now = time.monotonic()
        for line in lines:
            if line == b"PUSH self:cles/leaving reply=no":
                self.left = True
                self.lose_link()
                return
            head, _, text = line.decode().partition(" ")
            answer = json.loads(text[text.index("{"):])
            job = self.flying.pop(int(head.removeprefix("id=")))  # fails for a second answer
            job.ended, job.code = now, answer.get("error")

    def lose_link(self):
        """What was under way by it is lost, as every client has to see it; or has not begun, where the node has said
        that it leaves."""
        self.socket.close()
        self.linked = False
        for job in self.flying.values():
            job.ended, job.code = time.monotonic(), "busy" if self.left else "link lost"
        self.flying.clear()

    def run(self, seconds=None, until=None, what=""):
        """Sends jobs for some time, until a condition holds, or until the link is lost."""
        end = time.monotonic() + (seconds if seconds is not None else PATIENCE)
        while self.linked:
            now = time.monotonic()
            if until is not None and until():
                return
            if now >= end:
                if until is not None:
                    raise AssertionError(f"waited in vain: {what}")
                return
            if now >= self.next_due:
                if len(self.flying) < self.LIMIT:
                    self.send_next()
                self.next_due = max(self.next_due, now - 0.1) + self.PACE  # a late machine catches up only a little
            self.hear(min(self.next_due, end) - time.monotonic())

    def wait_until(self, condition, what):
        """Sends none meanwhile."""
        end = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > end or not self.linked:
                raise AssertionError(f"waited in vain: {what}")
            self.hear(0.01)

    def finish(self):
        """Sends no more, and waits for all answers."""
        end = time.monotonic() + DEADLINE + SLACK
        while self.flying and self.linked:
            if time.monotonic() > end:
                raise AssertionError(f"hang past their deadline: {list(self.flying.values())[:20]}")
            self.hear(end - time.monotonic())

    # -- counting ----------------------------------------------------------------------------------------------------

    def latest(self):
        """The longest time until a job was answered."""
        return max(job.ended - job.sent for job in self.jobs if job.code != "link lost")

    def fates(self):
        return collections.Counter(FATES[job.code] for job in self.jobs)

    def told(self):
        codes = collections.Counter(job.code or "done" for job in self.jobs)
        return f"{len(self.jobs)} jobs: " + ", ".join(f"{count} {code}" for code, count in codes.most_common())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()
