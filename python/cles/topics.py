# SPDX-License-Identifier: BSL-1.0
"""What a node publishes, and who has bound it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from . import jsontext
from .errors import Error
from .limits import Account, Budget, Limits
from .timers import MS, Timer, Timers


class Subscriber(Protocol):
    """The end of a link at which updates arrive."""

    account: Account

    def takes_updates(self) -> bool: ...

    def put_update(self, line: str) -> None: ...


class Topic:
    """One noun. `last` is the JSON of its last update; empty if there is none, or it has retired."""

    __slots__ = ("bindings", "held", "last", "mark", "path", "seq")

    def __init__(self, path: str, seq: int) -> None:
        self.path = path
        self.seq = seq
        self.last = ""
        self.mark = ""
        self.held = 0  # bytes of `last`
        self.bindings: dict[Subscriber, Binding] = {}


class Binding:
    """A subscriber of a topic, and the updates that it has not taken yet."""

    __slots__ = ("_held", "_limit", "_next_due", "_queue", "_timer", "_timers", "every", "keep", "subscriber")

    def __init__(self, subscriber: Subscriber, timers: Timers, limit: int) -> None:
        self.subscriber = subscriber
        self.every = 0  # nanoseconds
        self.keep = 0
        self._timers = timers
        self._limit = limit
        self._queue: deque[str] = deque()
        self._held = 0
        self._next_due = 0
        self._timer: Timer | None = None

    def set_terms(self, every_ms: int, keep: int) -> None:
        self.every = every_ms * MS
        self.keep = keep

    def offer(self, line: str, now: int) -> None:
        if not self._queue and not self.every and self.subscriber.takes_updates():
            self.subscriber.put_update(line)
            return
        size = len(line)
        most = 1 if self.every else self.keep
        while self._queue and (len(self._queue) >= most or self._held + size > self._limit):
            self._pop()
        while self._queue and not self.subscriber.account.try_hold(size):
            self._pop()  # the newest is always kept
        if not self._queue:
            self.subscriber.account.hold(size)
        self._queue.append(line)
        self._held += size
        self.drain(now)

    def _pop(self) -> str:
        line = self._queue.popleft()
        self._held -= len(line)
        self.subscriber.account.release(len(line))
        return line

    def drain(self, now: int) -> None:
        if self.every and self._queue:
            self._drain_newest(now)
            return
        while self._queue and self.subscriber.takes_updates():
            self.subscriber.put_update(self._pop())

    def _drain_newest(self, now: int) -> None:
        if now < self._next_due:
            if self._timer is None:
                self._timer = self._timers.at(self._next_due, self._on_due)
        elif self.subscriber.takes_updates():
            while len(self._queue) > 1:
                self._pop()
            self.subscriber.put_update(self._pop())
            self._next_due = now + self.every

    def _on_due(self, now: int) -> None:
        self._timer = None
        self.drain(now)

    def flush(self, now: int) -> None:
        """The node leaves: what `every` holds back is sent at once."""
        self._next_due = now
        self.drain(now)

    def waits(self) -> bool:
        """Whether the subscriber has not taken all yet."""
        return bool(self._queue)

    def end(self) -> None:
        while self._queue:
            self._pop()
        if self._timer is not None:
            self._timer.cancel()


class Topics:
    def __init__(self, node: str, epoch: str, limits: Limits, timers: Timers, budget: Budget) -> None:
        self._node = node
        self._epoch = epoch
        self._limits = limits
        self._timers = timers
        self._account = budget.account()
        self._topics: dict[str, Topic] = {}
        self._by_task: dict[str, dict[str, None]] = {}  # the least recently used first
        self._highest_retired = 0
        self.published: dict[str, None] = {}  # tasks, which stay open for BIND

    def find(self, path: str) -> Topic | None:
        return self._topics.get(path)

    def paths(self) -> list[str]:
        return sorted(path for path, topic in self._topics.items() if topic.last)

    def knows(self, task: str) -> bool:
        return task in self.published or task in self._by_task

    def can_publish(self, path: str) -> bool:
        return path in self._topics or self._has_room(path.partition("/")[0]) or self._idle(path) is not None

    def _has_room(self, task: str) -> bool:
        return len(self._by_task.get(task, ())) < self._limits.nouns

    def _idle(self, path: str) -> Topic | None:
        return next((topic for each in self._by_task[path.partition("/")[0]]
                     if not (topic := self._topics[each]).bindings), None)

    def open(self, path: str, *, to_publish: bool = False) -> Topic:
        topic = self._topics.get(path)
        if topic is not None:
            return topic
        task = path.partition("/")[0]
        if not self._has_room(task):
            idle = self._idle(path) if to_publish else None
            if idle is None:
                raise Error("busy", f"'{task}' has reached its limit of nouns")
            self.retire(idle.path)
        # Numbered above all that were removed, so that a noun that returns never uses a number again.
        topic = self._topics[path] = Topic(path, self._highest_retired)
        self._by_task.setdefault(task, {})[path] = None
        return topic

    def publish(self, path: str, body: str, now: int) -> None:
        self.prepare(path, body)
        self.commit(path, body, now)

    def prepare(self, path: str, body: str) -> None:
        """Opens the noun for an update, and takes the memory for it."""
        line_size = len(self._node) + len(path) + 64 + (len(body) if body.isascii() else len(body.encode()))
        if line_size > self._limits.line:
            raise Error("too_large", f"an update has at most {self._limits.line} bytes (limits.line)")
        if body.startswith('{"error":'):
            raise Error("failed", "an update whose first key is 'error' would be read as a failure")
        topic = self.open(path, to_publish=True)
        if len(body) > topic.held and not self._account.try_hold(len(body) - topic.held):
            self._remove_unused(topic)
            raise Error("busy", f"an update of '{path}' needs more memory than is left (limits.memory)")
        topic.held = max(topic.held, len(body))

    def commit(self, path: str, body: str, now: int) -> None:
        topic = self._topics[path]
        self._account.release(topic.held - len(body))
        topic.held = len(body)
        topic.seq += 1
        topic.last = body
        topic.mark = f"seq={topic.seq} epoch={self._epoch}"
        task = path.partition("/")[0]
        self.published[task] = None
        nouns = self._by_task[task]
        nouns[path] = nouns.pop(path)
        if topic.bindings:
            line = f"UPDATE {self._node}:{path} {topic.mark} {body}"
            for binding in list(topic.bindings.values()):
                binding.offer(line, now)

    def retire(self, path: str) -> bool:
        """Forgets the last value."""
        topic = self._topics.get(path)
        if topic is None or not topic.last:
            return False
        self._account.release(topic.held)
        topic.held = 0
        topic.last = topic.mark = ""
        self._remove_unused(topic)
        return True

    def _remove_unused(self, topic: Topic) -> None:
        if topic.bindings or topic.last:
            return
        self._highest_retired = max(self._highest_retired, topic.seq)
        task = topic.path.partition("/")[0]
        del self._topics[topic.path]
        del self._by_task[task][topic.path]
        if not self._by_task[task]:
            del self._by_task[task]

    def bind(self, topic: Topic, subscriber: Subscriber, every_ms: int, keep: int) -> None:
        binding = topic.bindings.get(subscriber)
        if binding is None:
            binding = topic.bindings[subscriber] = Binding(subscriber, self._timers, self._limits.binding_bytes)
        binding.set_terms(every_ms, keep)

    def unbind(self, path: str, subscriber: Subscriber) -> None:
        topic = self._topics.get(path)
        binding = topic.bindings.pop(subscriber, None) if topic else None
        if topic is not None and binding is not None:
            binding.end()
            self._remove_unused(topic)

    def drain(self, path: str, subscriber: Subscriber, now: int) -> None:
        topic = self._topics.get(path)
        if topic is not None and subscriber in topic.bindings:
            topic.bindings[subscriber].drain(now)

    def flush(self, now: int) -> None:
        for topic in self._topics.values():
            for binding in topic.bindings.values():
                binding.flush(now)

    def has_waiting(self) -> bool:
        return any(binding.waits() for topic in self._topics.values() for binding in topic.bindings.values())


def update_body(value: object, convert: Callable[[Any], Any]) -> str:
    """What is sent as a body or an update: as a result, a scalar is {"value":x}."""
    return jsontext.enclosed(jsontext.write(value, convert)) if value is not None else "{}"
