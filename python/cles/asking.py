# SPDX-License-Identifier: BSL-1.0
"""The requests that this node sends on a link, until they have their replies."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from . import grammar, jsontext
from .core import Core
from .datagrams import Copies
from .errors import Error, failure_of
from .grammar import Reply, Trace, Verb
from .timers import MS, Timer

if TYPE_CHECKING:
    from .session import Session


class Pending(Protocol):
    """Who waits for a reply; exactly one of the two is called, once."""

    def resolve(self, value: Any, reply: Reply) -> None: ...

    def reject(self, error: Error) -> None: ...


Progress = Callable[[float, Any], None]


class _Asked:
    __slots__ = ("copies", "describes", "due", "end_is_told", "pending", "progress", "reported", "timer")

    def __init__(self, pending: Pending, progress: Progress | None, due: int, describes: bool, end_is_told: bool) -> None:
        self.pending = pending
        self.progress = progress
        self.due = due
        self.describes = describes  # the node at the other end
        self.end_is_told = end_is_told  # the peer's own deadline began later
        self.reported = 0.0
        self.copies: Copies | None = None
        self.timer: Timer | None = None


class Asking:
    def __init__(self, core: Core, session: Session, *, by_datagram: bool, first_id: int = 1) -> None:
        self._core = core
        self._session = session
        self._by_datagram = by_datagram
        self._next_id = first_id
        self._waiting: dict[int, _Asked] = {}
        self._ends_after_long_line = False
        self._ended: Error | None = None
        self.peer_line = grammar.DATAGRAM if by_datagram else 1 << 62  # what the node at the other end reads, if known
        self.features: frozenset[str] | None = None  # None: not known

    def __len__(self) -> int:
        return len(self._waiting)

    def send(self, verb: Verb, noun: str, body: str, due: int, pending: Pending, *, progress: Progress | None = None,
             id: int = 0, urgent: bool = False, trace: Trace | None = None, hops: int = grammar.DEFAULT_HOPS,
             every: int = 0, keep: int = 0, lease: int | None = None, mark: bool = False, sig: str = "") -> int:
        """Returns the id. The request fails at `due`."""
        if self._ended is not None:
            raise self._ended
        if not id:
            id = self._next_id
            self._next_id = id + 1 if id < grammar.MAX_ID else 1
        now = self._core.now()
        left = min(max(-((now - due) // MS), 1), grammar.MAX_DEADLINE_MS)  # rounded up
        line = grammar.request_line(verb, noun, body, id=id, deadline=left, progress=progress is not None, urgent=urgent,
                                    trace=trace, lease=lease, every=every, keep=keep, hops=hops, mark=mark, sig=sig)
        limit = min(self.peer_line, self._core.limits.line) if not self._by_datagram else self.peer_line
        if len(line) * 4 > limit and len(line.encode()) > limit:
            raise Error("too_large", f"a request has at most {limit} bytes" +
                        (" by datagram: use TCP" if self._by_datagram else " at that node (its limits.line)"
                         if limit < self._core.limits.line else " (limits.line)"))
        asked = _Asked(pending, progress, due, verb == "PULL" and noun == "self:cles", verb == "DELEGATE")
        self._waiting[id] = asked
        if self._by_datagram:
            asked.copies = Copies(line, now)
            asked.timer = self._core.timers.at(min(asked.copies.next_due, due), lambda at: self._on_due(id, at))
        else:
            asked.timer = self._core.timers.at(due, lambda at: self._on_due(id, at))
        self._session.put(line)
        self._session.wake()
        return id

    def _on_due(self, id: int, now: int) -> None:
        asked = self._waiting[id]
        asked.timer = None
        if asked.copies is not None and now < asked.due:
            self._session.put(asked.copies.again(now))
            self._session.wake()
            asked.timer = self._core.timers.at(min(asked.copies.next_due, asked.due), lambda at: self._on_due(id, at))
            return
        if asked.end_is_told:
            self._cancel_at_peer(id)
        self._reject(id, Error("deadline", "no answer was received in time"))

    def cancel(self, id: int) -> None:
        if id in self._waiting:
            self._cancel_at_peer(id)
            self._reject(id, Error("cancelled", "the request was cancelled"))

    def _cancel_at_peer(self, id: int) -> None:
        noun = f"self:cles/cancel/{id}"
        if self._by_datagram:  # it may be lost
            self.send("PUSH", noun, "", self._core.now() + 5_000 * MS, _Nobody())
        else:
            self._session.put(grammar.request_line("PUSH", noun, wants_reply=False))
            self._session.wake()

    def _take(self, id: int) -> _Asked | None:
        asked = self._waiting.pop(id, None)
        if asked is not None and asked.timer is not None:
            asked.timer.cancel()
        return asked

    def _reject(self, id: int, error: Error) -> None:
        asked = self._take(id)
        if asked is not None:
            asked.pending.reject(error)

    # --- Replies ---

    def on_reply(self, reply: Reply) -> bool:
        """False: it answers nothing, or is malformed."""
        asked = self._waiting.get(reply.id)
        try:
            value = jsontext.read(reply.body, jsontext.ANSWER_DEPTH)
        except jsontext.Invalid:
            return False
        if reply.progress is not None:
            return asked is not None and self._on_progress(asked, reply.progress, value)
        if grammar.is_failure(reply.body):
            return self._on_failure(reply.id, failure_of(value))
        self._ends_after_long_line = False
        if asked is None:
            return False
        self._take(reply.id)
        if asked.describes:
            self.on_described(value)
        asked.pending.resolve(value, reply)
        return True

    def _on_progress(self, asked: _Asked, fraction: float, value: Any) -> bool:
        if asked.progress is None:
            return False
        if fraction >= asked.reported:  # datagrams may overtake each other
            asked.reported = fraction
            asked.progress(fraction, value)
        return True

    def _on_failure(self, id: int, error: Error) -> bool:
        is_withdrawn = self._ends_after_long_line and error.code == "cancelled"
        self._ends_after_long_line = not self._by_datagram and (
            is_withdrawn or (error.code == "too_large" and not error.ran))
        if is_withdrawn:
            error = Error("unavailable", "the node there has ended the link, because another request on it was longer than "
                                         "it reads (its limits.line)")
        if id not in self._waiting:
            return False
        self._reject(id, error)
        return True

    def on_described(self, told: Any) -> None:
        """What the reply to `PULL self:cles` tells of the node at the other end."""
        if not isinstance(told, dict):
            return
        features = told.get("features")
        self.features = frozenset(each for each in features if isinstance(each, str)) if isinstance(features, list) \
            else frozenset()
        limits = told.get("limits")
        line = limits.get("line") if isinstance(limits, dict) else None
        if isinstance(line, int) and not self._by_datagram:
            self.peer_line = max(line, 256)

    def on_overlong(self, id: int) -> None:
        self._reject(id, Error("too_large", f"the answer is longer than {self._core.limits.line} bytes (limits.line)",
                               ran=True))

    def end(self, error: Error) -> None:
        """The link takes no more requests."""
        self._ended = error
        self.lose(error)

    def lose(self, error: Error) -> None:
        """All of them fail."""
        for id in list(self._waiting):
            self._reject(id, error)


class _Nobody:
    def resolve(self, value: Any, reply: Reply) -> None:
        pass

    def reject(self, error: Error) -> None:
        pass
