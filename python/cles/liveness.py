# SPDX-License-Identifier: BSL-1.0
"""Whether the node at the other end of a stream still lives (docs/protocol.md, "The node at the other end")."""

from __future__ import annotations

from typing import Protocol

from .timers import MS, Timer, Timers

_PUNCTUAL = 500 * MS


class Watched(Protocol):
    def awaits_peer(self) -> bool:
        """Whether a reply is awaited there, or something is bound."""

    def may_be_asked(self) -> bool:
        """Whether the peer is known to be a node."""

    def ask_peer(self) -> None: ...

    def on_hung(self) -> None: ...


class Liveness:
    def __init__(self, timers: Timers, owner: Watched, silence: float) -> None:
        self._timers = timers
        self._owner = owner
        self._limit = int(silence * 1000) * MS
        self._pause = max(self._limit // 3, MS)
        self._heard = 0
        self._asked = 0  # when; 0: there is no open question
        self._timer: Timer | None = None

    def on_input(self, now: int) -> None:
        self._heard = now
        self._asked = 0

    def watch(self, now: int) -> None:
        """Something has been sent for which an answer is awaited."""
        if self._limit and self._timer is None:
            self._heard = now
            self._arm(now)

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _arm(self, now: int) -> None:
        due = now + self._pause
        self._timer = self._timers.at(due, lambda at: self._on_due(at, due))

    def _on_due(self, now: int, due: int) -> None:
        self._timer = None
        if not self._owner.awaits_peer():
            self._asked = 0
            return
        if now - due > _PUNCTUAL:  # suspended: what has arrived meanwhile is not read yet
            self._heard, self._asked = now, 0
        elif self._asked:
            if now - self._heard >= self._limit and now - self._asked >= self._limit - self._pause:
                self._owner.on_hung()
                return
        elif now - self._heard >= self._pause and self._owner.may_be_asked():
            self._asked = now
            self._owner.ask_peer()
        self._arm(now)
