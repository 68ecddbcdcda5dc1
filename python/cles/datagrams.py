# SPDX-License-Identifier: BSL-1.0
"""What holds for datagrams: a request runs once however often it arrives, and is sent again until it is answered
(docs/protocol.md, "UDP")."""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from .timers import MS, Timers

if TYPE_CHECKING:
    from .core import Core

_KEPT_FOR = 60_000 * MS
_AROUND_ENTRY = 128  # bytes
_LONGEST_REPLY = 1200


@dataclass(slots=True)
class _Entry:
    running: bool
    once: bool  # otherwise it may run again
    cost: int
    reply: str = ""


class Remembered:
    """The requests of one source, while they run and for a minute after their reply."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self._timers: Timers = core.timers
        self._entries: dict[tuple[int, str], _Entry] = {}
        self._running: dict[int, str] = {}
        self._answered: deque[tuple[int, tuple[int, str]]] = deque()

    def __bool__(self) -> bool:
        return bool(self._entries)

    def look(self, id: int, text: str) -> Literal["fresh", "running", "answered", "clash"]:
        entry = self._entries.get((id, text))
        if entry is not None:
            return "running" if entry.running else "answered"
        return "clash" if id in self._running else "fresh"

    def reply(self, id: int, text: str) -> list[str]:
        reply = self._entries[id, text].reply
        return [reply] if reply else []

    def begin(self, id: int, text: str) -> bool:
        """False: too much is remembered already."""
        cost = _AROUND_ENTRY + len(text) + _LONGEST_REPLY
        if self._core.remembered + cost > self._core.limits.remembered:
            return False
        self._enter(id, text, True, cost)
        return True

    def add_repeatable(self, id: int, text: str) -> None:
        self._enter(id, text, False, _AROUND_ENTRY + len(text))

    def _enter(self, id: int, text: str, once: bool, cost: int) -> None:
        self._entries[id, text] = _Entry(True, once, cost)
        self._running[id] = text
        self._core.remembered += cost

    def set_reply(self, id: int, reply: str, now: int) -> None:
        text = self._running.pop(id, None)
        if text is None:
            return
        key = id, text
        entry = self._entries[key]
        if not entry.once:
            self._forget(key)
            return
        entry.running = False
        entry.reply = reply
        self._core.remembered -= entry.cost
        entry.cost = _AROUND_ENTRY + len(text) + len(reply)
        self._core.remembered += entry.cost
        self._answered.append((now + _KEPT_FOR, key))
        if len(self._answered) == 1:
            self._timers.at(now + _KEPT_FOR, self._on_due)

    def _on_due(self, now: int) -> None:
        while self._answered and self._answered[0][0] <= now:
            self._forget(self._answered.popleft()[1])
        if self._answered:
            self._timers.at(self._answered[0][0], self._on_due)

    def _forget(self, key: tuple[int, str]) -> None:
        self._core.remembered -= self._entries.pop(key).cost


class Copies:
    """When a request is sent again: after 200 ms, then at intervals that double up to 10 s."""

    def __init__(self, line: str, now: int) -> None:
        self.line = line
        self._interval = 200 * MS
        self.next_due = self._next(now)

    def _next(self, now: int) -> int:
        return now + self._interval + int(self._interval * random.uniform(0, 0.25))

    def again(self, now: int) -> str:
        self._interval = min(self._interval * 2, 10_000 * MS)
        self.next_due = self._next(now)
        return self.line


class Reflection:
    """What is sent to addresses that cannot be trusted: less than 64 KiB in any second to each of them."""

    _AT_ONCE = 32_000
    _PER_SECOND = 32_000
    _MOST_ADDRESSES = 4096

    def __init__(self) -> None:
        self._tokens: dict[str, tuple[float, int]] = {}

    def admits(self, address: str, size: int, now: int) -> bool:
        tokens, at = self._tokens.get(address, (float(self._AT_ONCE), now))
        tokens = min(tokens + (now - at) * self._PER_SECOND / 1e9, float(self._AT_ONCE))
        if tokens < size:
            return False
        if address not in self._tokens and len(self._tokens) >= self._MOST_ADDRESSES:
            self._forget_full(now)
            if len(self._tokens) >= self._MOST_ADDRESSES:
                return False
        self._tokens[address] = tokens - size, now
        return True

    def _forget_full(self, now: int) -> None:
        self._tokens = {address: (tokens, at) for address, (tokens, at) in self._tokens.items()
                        if tokens + (now - at) * self._PER_SECOND / 1e9 < self._AT_ONCE}
