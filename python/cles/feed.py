# SPDX-License-Identifier: BSL-1.0
"""Feeds: what a program has bound, across lost links and restarted publishers."""

from __future__ import annotations

import asyncio
import random
from collections import deque
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from . import grammar
from .errors import Error, RefusedError
from .following import Subscription
from .types import from_json, unwrapped

if TYPE_CHECKING:
    from .links import Link
    from .node import Node

T = TypeVar("T")
_FIRST_PAUSE, _LONGEST_PAUSE, _PROVEN = 0.1, 5.0, 5.0


@dataclass(frozen=True, slots=True)
class Update(Generic[T]):
    """A value of a feed. `seq` is 0 for the last value at the time of the binding, if its number is not known."""

    value: T
    publisher: str
    seq: int
    missed: int = 0  #: updates that were lost just before this one
    restarted: bool = False  #: the publisher has been restarted since the last update


class Feed(Generic[T]):
    """Made by `Node.bind`: `async with node.bind("car1:speed") as feed: async for update in feed: ...`.

    If the publisher is lost, the feed binds again by itself. A queue of `Limits.feed` updates holds what is not fetched
    yet; the oldest are dropped and show as missing.
    """

    def __init__(self, node: Node, noun: str, type: Any, *, every_ms: int, keep: int, at: str | None,
                 lost: Callable[[str], None] | None, rebound: Callable[[], None] | None) -> None:
        self._node = node
        self._noun = noun
        self._type = type
        self._every = every_ms
        self._keep = keep
        self._at = at
        self._lost = lost
        self._rebound = rebound
        parts = grammar.parse_noun(noun)
        limits = node.limits
        self._target = parts.target
        self.subscription = Subscription(parts.target, parts.path, self._deliver, thinned=bool(every_ms),
                                         publishers=limits.publishers)
        self._queue: deque[Update[T]] = deque()
        self._most = limits.feed
        self._waiter: asyncio.Future[None] | None = None
        self._link: Link | None = None
        self._task: asyncio.Task[None] | None = None
        self._renewal: asyncio.Task[None] | None = None
        self._gone = asyncio.Event()
        self._why = ""
        self._closed = False

    @property
    def is_bound(self) -> bool:
        return self._link is not None

    async def __aenter__(self) -> Feed[T]:
        await self._bind()
        self._task = asyncio.create_task(self._keep_bound())
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    def __aiter__(self) -> AsyncIterator[Update[T]]:
        return self

    async def __anext__(self) -> Update[T]:
        while not self._queue:
            if self._closed:
                raise StopAsyncIteration
            self._waiter = asyncio.get_running_loop().create_future()
            await self._waiter
        return self._queue.popleft()

    async def close(self) -> None:
        """Ends the binding."""
        self._closed = True
        self._wake()
        for task in (self._task, self._renewal):
            if task is not None:
                task.cancel()
        link, self._link = self._link, None
        if link is not None:
            link.session.subscriptions.remove(self.subscription)
            self._node.forget_feed(self, link)
            if link.usable:
                try:
                    await self._node.ask_on(link, "BIND", self._noun, lease=0, deadline=1.0)
                except Error:
                    pass  # it ends with its link

    # --- From the link ---

    def _deliver(self, publisher: str, seq: int, value: Any, missed: int, restarted: bool) -> None:
        try:
            read = unwrapped(value) if self._type is None else from_json(value, self._type, is_content=True)
        except Exception as error:  # a type of the program decides
            self._node.log.warning("an update of %s was dropped: %s", self._noun, error)
            return
        while len(self._queue) >= self._most:
            dropped = self._queue.popleft().missed + (0 if self._every else 1)
            if self._queue:
                self._queue[0] = replace(self._queue[0], missed=self._queue[0].missed + dropped)
            else:
                missed += dropped
        self._queue.append(Update(read, publisher, seq, missed, restarted))
        self._wake()

    def _wake(self) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)

    def on_unusable(self, why: str) -> None:
        """The link is lost, or its peer leaves."""
        link, self._link = self._link, None
        if link is not None:
            link.session.subscriptions.remove(self.subscription)
            self._why = why
            self._gone.set()

    # --- Binding ---

    async def _bind(self) -> None:
        link = await self._node.link_for_feed(self, self._target, self._at)
        session = link.session
        if not session.subscriptions.add(self.subscription):
            raise Error("failed", f"{self._noun} is bound on this link already")
        self._gone.clear()
        self._link = link
        try:
            lease = int(self._node.limits.lease * 1000) if self._is_leased(link) else None
            # The reply is taken when it arrives: updates may follow it at once.
            await self._node.ask_on(link, "BIND", self._noun, every=self._every, keep=self._keep, lease=lease,
                                    mark="mark" in (session.asking.features or ()), on_reply=self._take_reply)
        except BaseException:
            session.subscriptions.remove(self.subscription)
            self._node.forget_feed(self, link)
            self._link = None
            raise
        if self._is_leased(link):
            self._renewal = asyncio.create_task(self._renew(link))

    @staticmethod
    def _is_leased(link: Link) -> bool:
        return link.session.asking.peer_line == grammar.DATAGRAM

    def _take_reply(self, value: Any, reply: grammar.Reply) -> None:
        """The reply to BIND is the last value; `all` has one for each node."""
        if self._target == "all":
            results = value.get("results", {}) if isinstance(value, dict) else {}
            marks = value.get("marks", {}) if isinstance(value, dict) else {}
            for publisher, each in results.items() if isinstance(results, dict) else ():
                mark = marks.get(publisher, {}) if isinstance(marks, dict) else {}
                known = isinstance(mark, dict)
                self._take_current(publisher, each, mark.get("seq", 0) if known else 0, mark.get("epoch", "") if known else "")
        elif self._counts(self._target):
            self._take_current(self._target, value, reply.seq, reply.epoch)

    def _counts(self, publisher: str) -> bool:
        """In a secured fleet, the value in a reply to BIND is not signed."""
        confirmation = self._link.session.confirmation if self._link is not None else None
        return confirmation is None or publisher == "self" or \
            confirmation.may_take_value(publisher, self.subscription.path.partition("/")[0])

    def _take_current(self, publisher: str, value: Any, seq: Any, epoch: Any) -> None:
        if value == {}:
            return  # there was no update
        if isinstance(seq, int) and seq > 0 and isinstance(epoch, str) and epoch:
            self.subscription.take(publisher, epoch, seq, value)  # a repeat is dropped, a gap or a restart shows
        else:
            self._deliver(publisher, 0, value, 0, False)

    async def _keep_bound(self) -> None:
        loop = asyncio.get_running_loop()
        pause = _FIRST_PAUSE
        bound_at = loop.time()
        while not self._closed:
            await self._gone.wait()
            if loop.time() - bound_at >= _PROVEN:
                pause = _FIRST_PAUSE
            if self._lost is not None:
                self._lost(self._why)
            while self._link is None:
                await asyncio.sleep(pause * random.uniform(1, 1.25))
                pause = min(pause * 2, _LONGEST_PAUSE)
                try:
                    await self._bind()
                except (Error, RefusedError) as error:
                    self._node.log.debug("%s cannot be bound again yet: %s", self._noun, error)
            bound_at = loop.time()
            if self._rebound is not None:
                self._rebound()

    async def _renew(self, link: Link) -> None:
        """A binding by datagram lives for its lease."""
        lease = self._node.limits.lease
        end = asyncio.get_running_loop().time() + lease
        while self._link is link:
            await asyncio.sleep(lease / 3 * random.uniform(0.75, 1))
            left = end - asyncio.get_running_loop().time()
            sent = asyncio.get_running_loop().time()
            try:
                await self._node.ask_on(link, "BIND", self._noun, every=self._every, keep=self._keep,
                                        lease=int(lease * 1000), deadline=max(left, 0.02))
            except Error as error:
                if error.code == "busy":
                    continue
                if error.code != "too_large":
                    self._node.forget_feed(self, link)
                    self.on_unusable("the publisher did not renew the lease in time" if error.code == "deadline" else
                                     error.message)
                    return
            end = sent + lease


def check_terms(every: float | None, keep: int | None) -> tuple[int, int]:
    every_ms = 0 if every is None else min(round(every * 1000), 86_400_000)
    if every is not None and every_ms < 1:
        raise ValueError("every: at least a millisecond")
    if keep is not None and not 1 <= keep <= 65_536:
        raise ValueError("keep: from 1 to 65536")
    return every_ms, keep or 0
