# SPDX-License-Identifier: BSL-1.0
"""Limits on what peers can make a node use (docs/protocol.md, "Limits")."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Limits:
    """Beyond a limit on a count, requests are `busy`; beyond one on a size, `too_large`. Times are seconds."""

    line: int = 1 << 20  #: bytes of a line
    depth: int = 32  #: nested brackets of a request's body
    links: int = 1024  #: links that others opened, and as many sources of datagrams
    in_flight: int = 4096  #: requests of a link that wait or run
    bindings: int = 1024  #: bindings of a link
    nouns: int = 4096  #: nouns of a task that are published or bound
    running: int = 16384  #: handlers that have not ended
    unread: int = 1 << 20  #: bytes of replies that a peer has not read, beyond which its link is not read
    waiting: int = 1 << 20  #: bytes of requests that wait on a link, beyond which it is not read
    binding_bytes: int = 4 << 20  #: bytes of updates queued for a binding
    remembered: int = 16 << 20  #: bytes of requests by datagram that are remembered, with their replies
    memory: int = 256 << 20  #: bytes held for all peers
    feed: int = 1024  #: updates that a feed of this program queues
    publishers: int = 1024  #: publishers that a feed of `all:` distinguishes
    stall: float = 30.0  #: a peer that reads nothing for so long is lost
    lease: float = 10.0  #: of a binding by datagram
    connect: float = 5.0  #: until a link is open
    discard: float = 1.0  #: how long input is discarded before a link is closed
    first_line: float = 60.0  #: until a link that a peer has opened has received a line
    probe: float = 5.0  #: when a peer that has ended its stream is first probed
    silence: float = 10.0  #: of a node that is waited for


class Budget:
    """The bytes that are held for peers. A link may hold as much as remains free for the others."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.used = 0
        self.refused = 0

    def account(self) -> Account:
        return Account(self)


class Account:
    """What is held for one link."""

    __slots__ = ("_budget", "held")

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self.held = 0

    def try_hold(self, size: int) -> bool:
        budget = self._budget
        if self.held + size > budget.limit - budget.used:
            budget.refused += 1
            return False
        self.hold(size)
        return True

    def hold(self, size: int) -> None:
        self.held += size
        self._budget.used += size

    def release(self, size: int) -> None:
        self.held -= size
        self._budget.used -= size
