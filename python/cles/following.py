# SPDX-License-Identifier: BSL-1.0
"""What a subscriber recognises from the numbers of updates (docs/protocol.md, "Updates")."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable
from typing import Any

from .grammar import Request


class Order:
    """The updates of one publisher and noun."""

    __slots__ = ("_before", "epoch", "seq")

    def __init__(self) -> None:
        self.epoch = ""
        self.seq = 0
        self._before: deque[str] = deque(maxlen=4)

    def take(self, epoch: str, seq: int) -> tuple[int, bool] | None:
        """How many updates are missing before this one, and whether the publisher has restarted. None: it is old or
        repeated."""
        if epoch == self.epoch:
            if seq <= self.seq:
                return None
            missed = seq - self.seq - 1
            self.seq = seq
            return missed, False
        if epoch in self._before:
            return None
        restarted = bool(self.epoch)
        if restarted:
            self._before.append(self.epoch)
        self.epoch, self.seq = epoch, seq
        return 0, restarted


#: Takes an update: publisher, number, value, how many are missing before it, whether the publisher has restarted.
Deliver = Callable[[str, int, Any, int, bool], None]


class Subscription:
    """What this program has bound on a link. `target` is a node, `self` or `all`."""

    def __init__(self, target: str, path: str, deliver: Deliver, *, thinned: bool = False, publishers: int = 1024) -> None:
        self.target = target
        self.path = path
        self._deliver = deliver
        self._thinned = thinned
        self._most = publishers
        self._orders: OrderedDict[str, Order] = OrderedDict()

    def take(self, publisher: str, epoch: str, seq: int, value: Any) -> bool:
        """False: it is old or repeated."""
        key = publisher if self.target == "all" else ""
        order = self._orders.get(key)
        if order is None:
            if len(self._orders) >= self._most:
                self._orders.popitem(last=False)  # the one that has been silent for longest
            order = self._orders[key] = Order()
        elif key:
            self._orders.move_to_end(key)
        found = order.take(epoch, seq)
        if found is None:
            return False
        missed, restarted = found
        self._deliver(publisher, seq, value, 0 if self._thinned else missed, restarted)
        return True


class Subscriptions:
    """Those of one link."""

    def __init__(self) -> None:
        self._by_path: dict[str, list[Subscription]] = {}

    def __bool__(self) -> bool:
        return bool(self._by_path)

    def admits(self, subscription: Subscription) -> bool:
        """False: an update could not be assigned to one of two."""
        return not any(_overlap(each.target, subscription.target) for each in self._by_path.get(subscription.path, ()))

    def add(self, subscription: Subscription) -> bool:
        if not self.admits(subscription):
            return False
        self._by_path.setdefault(subscription.path, []).append(subscription)
        return True

    def remove(self, subscription: Subscription) -> None:
        known = self._by_path.get(subscription.path, [])
        if subscription in known:
            known.remove(subscription)
            if not known:
                del self._by_path[subscription.path]

    def find(self, update: Request) -> Subscription | None:
        of_all = None
        for each in self._by_path.get(update.noun.path, ()):
            if each.target in (update.noun.target, "self"):
                return each
            if each.target == "all":
                of_all = each
        return of_all


def _overlap(a: str, b: str) -> bool:
    return a == b or a in ("self", "all") or b in ("self", "all")
