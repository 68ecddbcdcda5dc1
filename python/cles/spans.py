# SPDX-License-Identifier: BSL-1.0
"""The spans of traced requests (docs/protocol.md, "Traces")."""

from __future__ import annotations

import secrets
from collections import deque
from dataclasses import dataclass, replace
from typing import Any

from .grammar import Request, Trace
from .timers import MS

_MOST_OPEN = 1024
_MOST_ENDED = 2048
_KEPT_FOR = 60_000 * MS


@dataclass(slots=True)
class Span:
    id: str
    trace: str
    parent: str
    kind: str
    verb: str
    target: str
    task: str
    begun: int
    queued: int = 0
    ran: int = 0
    over: int = 0
    outcome: str = ""


class Spans:
    def __init__(self) -> None:
        self._open: dict[str, Span] = {}
        self._ended: deque[Span] = deque(maxlen=_MOST_ENDED)

    def receive(self, request: Request, arrived: int, now: int) -> Trace:
        trace = request.trace
        assert trace is not None
        return self._begin("received", request.verb, request.noun.target, request.noun.task, trace, arrived, now)

    def send(self, verb: str, target: str, task: str, trace: Trace, now: int) -> Trace:
        return self._begin("sent", verb, target, task, trace, now, now)

    def _begin(self, kind: str, verb: str, target: str, task: str, trace: Trace, begun: int, now: int) -> Trace:
        self._forget(now)
        if len(self._open) >= _MOST_OPEN:
            return trace  # what it causes belongs to the parent
        own = f"{secrets.randbits(64) | 1:016x}"
        self._open[own] = Span(own, trace.id, trace.span, kind, verb, target, task, begun, now - begun)
        return replace(trace, span=own)

    def ran(self, span: str, time: int) -> None:
        if span in self._open:
            self._open[span].ran += time

    def end(self, span: str, outcome: str, now: int) -> None:
        found = self._open.pop(span, None)
        if found is not None:
            found.over = max(now, found.begun)
            found.outcome = outcome
            self._ended.append(found)

    def _forget(self, now: int) -> None:
        while self._ended and now - self._ended[0].over > _KEPT_FOR:
            self._ended.popleft()

    def describe(self, trace: str, now: int) -> list[dict[str, Any]]:
        self._forget(now)
        found = sorted((s for s in [*self._ended, *self._open.values()] if s.trace == trace), key=lambda s: s.begun)
        return [_described(s, found[0].begun) for s in found]


def _described(span: Span, start: int) -> dict[str, Any]:
    out: dict[str, Any] = {"span": span.id, "parent": span.parent, "kind": span.kind, "verb": span.verb,
                           "target": span.target, "task": span.task, "start_us": (span.begun - start) / 1000}
    if span.kind == "received":
        out |= {"queue_us": span.queued / 1000, "run_us": span.ran / 1000}
    if span.outcome:
        out |= {"total_us": (span.over - span.begun) / 1000, "outcome": span.outcome}
    return out
