# SPDX-License-Identifier: BSL-1.0
"""The reserved task `cles`, which each node has (docs/protocol.md, "The reserved task")."""

from __future__ import annotations

import re
from typing import Any

from . import grammar, jsontext
from .core import Core, Peer
from .errors import Error, RefusedError
from .grammar import Request

_HEAD = 23  # bytes, of a reply with the longest id


class Reserved:
    """Serves it at one link. `longest` is how many bytes a reply has at most."""

    def __init__(self, core: Core, longest: int, *, by_datagram: bool) -> None:
        self._core = core
        self._longest = longest
        self._by_datagram = by_datagram

    def serve(self, r: Request, peer: Peer) -> str:
        """The JSON of the reply."""
        security = self._core.security
        if security is not None and r.noun.parameters == ("roster",):
            if r.verb == "PULL":
                return security.roster_line
            if r.verb == "PUSH":
                try:
                    security.offer(r.body)
                except RefusedError as error:
                    raise Error("bad_request", str(error)) from None
                return "{}"
        if security is not None and r.verb == "PULL" and len(r.noun.parameters) == 2 and \
                r.noun.parameters[0] == "announced":
            if not re.fullmatch(r"[A-Za-z0-9_-]{22}", r.noun.parameters[1]):
                raise Error("bad_request", "a challenge is 16 bytes as base64url")
            return self._core.announcement(r.noun.path)
        return jsontext.write(self._tell(r, peer))

    def _tell(self, r: Request, peer: Peer) -> Any:
        core = self._core
        parameters = r.noun.parameters
        if r.verb == "PULL":
            match parameters:
                case ():
                    return self._description()
                case ("metrics",):
                    return core.metrics()
                case ("peers",):
                    return {"peers": []}  # it knows no other nodes
                case ("trace", id):
                    if not grammar.is_trace_id(id):
                        raise Error("bad_request", "a trace is named by 32 lower-case hex digits, not all 0")
                    return {"node": core.name, "spans": core.spans.describe(id, core.now())}
                case ("types", task):
                    told = core.tell_types(task)
                    if told is None:
                        raise Error("no_task", f"{core.name} has no task {grammar.quoted(task)}")
                    return told
                case ("nouns",):
                    return self._nouns(peer, r)
        if r.verb == "PUSH" and len(parameters) == 2 and parameters[0] == "cancel":
            raise Error("bad_request", "cancel needs an id from 1 to 2^63-1")
        raise Error("no_task", f"{core.name} has no {r.verb} {grammar.quoted(r.noun.path)}")

    def _description(self) -> Any:
        told: Any = None
        for tasks in ("described", "named", "none"):
            told = self._core.describe(tasks=tasks)
            if not self._by_datagram or len(jsontext.write(told).encode()) + _HEAD <= self._longest:
                break
        return told

    def _nouns(self, peer: Peer, asked: Request) -> Any:
        core = self._core
        paths: list[str] = []
        size = 256  # what is around them
        for path in core.topics.paths():
            r = Request("BIND", grammar.parse_noun(f"self:{path}"), sender=asked.sender)
            if core.security is not None and core.security.refusal(peer, r) is not None:
                continue
            if core.authorise is not None and not core.authorise(core.access(peer, r)):
                continue
            size += len(path) + 3
            if size > self._longest:
                return {"nouns": paths, "more": True}
            paths.append(path)
        return {"nouns": paths}
