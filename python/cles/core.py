# SPDX-License-Identifier: BSL-1.0
"""What the links of a node have in common: its tasks, what it publishes, limits, time. No I/O: time is a function that is
passed in, and what is due later waits in `timers`."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

from . import grammar, jsontext
from .errors import Error
from .grammar import Request, Verb
from .limits import Budget, Limits
from .spans import Spans
from .timers import MS, Timers
from .topics import Topics

if TYPE_CHECKING:
    from .serving import Call

VERSION = "1.0.0"
#: The additions to the first version that nodes of this library understand.
FEATURES = ("mark", "trace", "types")
INTERVAL_MS = 1000  # between announcements


@dataclass(frozen=True, slots=True)
class Peer:
    """Who is at the other end of a link. `name` is proven: of a member of the fleet, otherwise empty."""

    transport: str
    address: str
    name: str = ""
    uid: int | None = None


@dataclass(frozen=True, slots=True)
class Access:
    """A request whose access is to be decided. In a secured fleet, `requester` is the member whose request it is. If another
    member has forwarded it, which is then the peer, `forwarded_by` is its name."""

    peer: Peer
    verb: Verb
    noun: grammar.Noun
    requester: str = ""
    forwarded_by: str = ""


@dataclass(slots=True)
class Task:
    """How a verb of a task is served. `types` is what it tells about its types, by part."""

    start: Callable[[Call], None]
    description: str = ""
    parameters: tuple[str, ...] = ()
    idempotent: bool = False
    types: dict[str, Any] = field(default_factory=dict)


class Security(Protocol):
    """The rights of a fleet's members."""

    def refusal(self, peer: Peer, request: Request) -> Error | None: ...

    def requester(self, peer: Peer, request: Request) -> str: ...

    def offer(self, line: str) -> None: ...

    def sign_update(self, noun: str, seq: int, epoch: str, body: str) -> str: ...

    @property
    def version(self) -> int: ...

    @property
    def roster_line(self) -> str: ...


def _state(leaving: bool) -> str:
    return "left" if leaving else "live"


class Core:
    def __init__(self, name: str, clock: Callable[[], int], limits: Limits | None = None, epoch: str = "") -> None:
        self.name = grammar.check_node(name)
        self.now = clock
        self.limits = limits or Limits()
        self.epoch = epoch or secrets.token_hex(4)
        self.started = clock()
        self.timers = Timers()
        self.budget = Budget(self.limits.memory)
        self.topics = Topics(name, self.epoch, self.limits, self.timers, self.budget)
        self.spans = Spans()
        self.tasks: dict[str, dict[Verb, Task]] = {}
        self.opened: set[str] = set()
        self.endpoints: list[str] = []
        self.authorise: Callable[[Access], bool] | None = None
        self.security: Security | None = None
        self.running = 0  # handlers
        self.remembered = 0  # bytes, of requests by datagram
        self.leaving = False
        self.requests: dict[str, int] = dict.fromkeys(grammar.VERBS, 0)
        self.counts: dict[str, int] = {}
        self.pool = ""
        self.announcements = 0
        self.load: Callable[[], dict[str, int]] | None = None

    def count(self, what: str) -> None:
        self.counts[what] = self.counts.get(what, 0) + 1

    def add(self, verb: Verb, task: str, entry: Task) -> None:
        verbs = self.tasks.setdefault(grammar.check_task(task), {})
        if verb in verbs:
            raise ValueError(f"{self.name} has {verb} '{task}' already")
        verbs[verb] = entry

    def can_bind(self, task: str) -> bool:
        verbs = self.tasks.get(task, {})
        return "BIND" in verbs or "UPDATE" in verbs or task in self.opened or self.topics.knows(task)

    def access(self, peer: Peer, request: Request) -> Access:
        """Who asks for what. Without security, nobody has proved a name."""
        asked = Access(peer, request.verb, request.noun)
        if self.security is None:
            return asked
        return replace(asked, requester=self.security.requester(peer, request),
                       forwarded_by=peer.name if request.sender else "")

    def publish(self, path: str, body: str) -> None:
        self.topics.publish(path, body, self.now())

    def describe(self, *, tasks: str = "described") -> dict[str, Any]:
        """The reply to `PULL self:cles`. `tasks`: `described`, `named` or `none`, for what a datagram holds."""
        out: dict[str, Any] = {
            "node": self.name, **({"pool": self.pool} if self.pool else {}), "version": VERSION, "protocol": 1, "features": list(FEATURES),
            "limits": {"line": self.limits.line}, "epoch": self.epoch, "uptime_ms": (self.now() - self.started) // MS,
            "endpoints": self.endpoints, "tasks": None if tasks == "none" else self._list_tasks(tasks == "described"),
            "types": self.types_digest(), "load": self.load_now(),
        }
        if self.security is not None:
            out["roster"] = self.security.version
        return out

    def _list_tasks(self, described: bool) -> list[dict[str, Any]]:
        out = []
        for task in sorted({*self.tasks, *self.opened, *self.topics.published}):
            verbs = self.tasks.get(task, {})
            for verb in grammar.VERBS:
                entry = verbs.get(verb)
                if entry is None and not (verb == "BIND" and self.can_bind(task)):
                    continue
                told: dict[str, Any] = {"verb": verb, "task": task}
                if entry is not None:
                    if described and entry.description:
                        told["description"] = entry.description
                    if entry.parameters:
                        told["parameters"] = list(entry.parameters)
                    if entry.idempotent:
                        told["idempotent"] = True
                out.append(told)
        return out

    def load_now(self) -> dict[str, int]:
        return self.load() if self.load else {"queued": 0, "running": self.running, "workers": 0}

    def tell_types(self, task: str) -> dict[str, Any] | None:
        """By verb, what the task tells about its types. None: there is no such task."""
        if task not in self.tasks and not self.can_bind(task):
            return None
        verbs = self.tasks.get(task, {})
        return {verb: verbs[verb].types for verb in grammar.VERBS if verb in verbs and verbs[verb].types}

    def types_digest(self) -> str:
        return _digest("".join(f"{task} {self.tell_types(task)}\n" for task in sorted(self.tasks)))

    def tasks_digest(self) -> str:
        return _digest(jsontext.write(self._list_tasks(True)))

    def announcement(self, noun: str, *, leaving: bool = False) -> str:
        """What this member announces of itself, signed as an update of this noun: the reply to `PULL
        self:cles/announced/<challenge>`, by which others confirm the epoch, and with more members an entry of gossip."""
        assert self.security is not None
        self.announcements += 1
        # It listens on Unix sockets only, which others are told by their configuration.
        told = {"node": self.name, **({"pool": self.pool} if self.pool else {}), "endpoints": [], "load": self.load_now(),
                "interval_ms": INTERVAL_MS, "sources": [], "tasks": self.tasks_digest(), "roster": self.security.version,
                **({"leaving": True} if leaving else {})}
        body = jsontext.write(told)
        sig = self.security.sign_update(noun, self.announcements, self.epoch, body)
        return f'{{"announced":{body},"seq":{self.announcements},"epoch":"{self.epoch}","sig":"{sig}"}}'

    def entry(self, *, leaving: bool = False) -> str:
        """A table that contains this node, for a node of its pool."""
        if self.security is not None:
            entry = self.announcement("cles", leaving=leaving)[:-1] + f',"age_ms":0,"state":"{_state(leaving)}"}}'
        else:
            self.announcements += 1
            entry = jsontext.write({
                "node": self.name, "endpoints": self.endpoints, "epoch": self.epoch, "seq": self.announcements, "age_ms": 0,
                "interval_ms": INTERVAL_MS, "state": _state(leaving), "load": self.load_now(), "tasks": self.tasks_digest()})
        pool = f'"pool":"{self.pool}",' if self.pool else ""
        return f'{{"node":"{self.name}","epoch":"{self.epoch}",{pool}"peers":[{entry}]}}'

    def metrics(self) -> dict[str, Any]:
        return {"uptime_ms": (self.now() - self.started) // MS, "requests": self.requests, **self.counts,
                "memory": {"limit": self.budget.limit, "used": self.budget.used, "refused": self.budget.refused}}


def _digest(text: str) -> str:
    """FNV-1a, which others only compare."""
    value = 0xCBF29CE484222325
    for byte in text.encode():
        value = (value ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return f"{value:016x}"
