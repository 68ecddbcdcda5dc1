# SPDX-License-Identifier: BSL-1.0
"""Points in time at which something is due. They are nanoseconds of a clock that never goes back."""

from __future__ import annotations

import heapq
from collections.abc import Callable

MS = 1_000_000  # nanoseconds


class Timer:
    __slots__ = ("_timers", "call")

    def __init__(self, timers: Timers, call: Callable[[int], None]) -> None:
        self._timers = timers
        self.call: Callable[[int], None] | None = call

    def cancel(self) -> None:
        if self.call is not None:
            self.call = None
            self._timers.on_cancelled()


class Timers:
    def __init__(self) -> None:
        self._heap: list[tuple[int, int, Timer]] = []
        self._count = 0
        self._cancelled = 0

    def at(self, due: int, call: Callable[[int], None]) -> Timer:
        timer = Timer(self, call)
        self._count += 1
        heapq.heappush(self._heap, (due, self._count, timer))
        return timer

    def on_cancelled(self) -> None:
        self._cancelled += 1
        if self._cancelled > 64 and self._cancelled > len(self._heap) // 2:
            self._heap = [each for each in self._heap if each[2].call is not None]
            heapq.heapify(self._heap)
            self._cancelled = 0

    def next_due(self) -> int | None:
        while self._heap and self._heap[0][2].call is None:
            heapq.heappop(self._heap)
            self._cancelled -= 1
        return self._heap[0][0] if self._heap else None

    def run(self, now: int) -> None:
        """Calls what is due, in order."""
        while (due := self.next_due()) is not None and due <= now:
            timer = heapq.heappop(self._heap)[2]
            call, timer.call = timer.call, None
            if call is not None:
                call(now)
