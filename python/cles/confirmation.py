# SPDX-License-Identifier: BSL-1.0
"""Which updates that another node of a secured fleet passes on are believed (docs/protocol_security.md, "Signed updates",
"Confirmed epochs")."""

from __future__ import annotations

import secrets
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from . import ed25519, jsontext
from .errors import RefusedError
from .fleet import Fleet, read_base64url, to_base64url
from .grammar import Request
from .timers import MS

_MOST_HELD = 64
_MOST_BYTES = 256 * 1024


@dataclass(frozen=True, slots=True)
class _Confirmed:
    epoch: str
    signed: frozenset[str]  # the tasks whose updates are signed


class Confirmation:
    """Of one link. `ask(noun, answer)` sends PULL there, and calls `answer` with the text of the reply, or with "" if there is
    none. `deliver` gets updates that were held."""

    def __init__(self, fleet: Fleet, peer: str, clock: Callable[[], int], ask: Callable[[str, Callable[[str], None]], None],
                 deliver: Callable[[Request], None], count: Callable[[str], None]) -> None:
        self._fleet = fleet
        self._peer = peer
        self._clock = clock
        self._ask = ask
        self._deliver = deliver
        self._count = count
        self._confirmed: dict[str, _Confirmed] = {}
        self._asked: dict[str, int] = {}
        self._held: deque[Request] = deque()
        self._held_bytes = 0

    def admits(self, update: Request) -> bool:
        """False: it is dropped, or delivered later."""
        publisher = update.noun.target
        known = self._confirmed.get(publisher)
        if publisher == self._peer or (known is not None and known.epoch == update.epoch):
            return self._is_signed_as_stated(update, known)
        if publisher in self._fleet.roster.by_name:
            self._hold(update)
        else:
            self._count("updates_unsigned")
        return False

    def may_take_value(self, publisher: str, task: str) -> bool:
        """Whether the value in a reply to BIND counts, which is not signed."""
        known = self._confirmed.get(publisher)
        return publisher == self._peer or (known is not None and task not in known.signed)

    def _is_signed_as_stated(self, update: Request, known: _Confirmed | None) -> bool:
        noun = update.noun
        if update.sig:
            holds = is_update_signed(self._fleet, noun.target, noun.path, update.seq, update.epoch, update.body or "{}", update.sig)
        else:
            holds = known is None or noun.task not in known.signed
        if not holds:
            self._count("updates_unsigned")
        return holds

    def _hold(self, update: Request) -> None:
        self._held.append(update)
        self._held_bytes += len(update.text)
        while len(self._held) > _MOST_HELD or self._held_bytes > _MOST_BYTES:
            self._held_bytes -= len(self._held.popleft().text)
        publisher, now = update.noun.target, self._clock()
        if now - self._asked.get(publisher, -(2**62)) < 1_000 * MS or len(self._asked) > 4096:
            return
        self._asked[publisher] = now
        noun = f"cles/announced/{to_base64url(secrets.token_bytes(16))}"
        self._ask(f"{publisher}:{noun}", lambda text: self._on_answer(publisher, noun, text))

    def _on_answer(self, publisher: str, noun: str, text: str) -> None:
        confirmed = _read_answer(self._fleet, publisher, noun, text)
        if confirmed is not None:
            self._confirmed[publisher] = confirmed
        held, self._held, self._held_bytes = self._held, deque(), 0
        for update in held:
            if update.noun.target != publisher:
                self._held.append(update)
                self._held_bytes += len(update.text)
            elif confirmed is None or confirmed.epoch != update.epoch:
                self._count("updates_unsigned")
            elif self._is_signed_as_stated(update, confirmed):
                self._deliver(update)


def is_update_signed(fleet: Fleet, publisher: str, noun: str, seq: int, epoch: str, body: str, sig: str) -> bool:
    member = fleet.roster.by_name.get(publisher)
    text = f"cles update 1\n{fleet.roster.fleet_text}\n{publisher}\n{noun}\n{seq} {epoch}\n{body}\n"
    try:
        return member is not None and ed25519.verify(member.key, text.encode(), read_base64url(sig, 64))
    except RefusedError:
        return False


def _read_answer(fleet: Fleet, publisher: str, noun: str, text: str) -> _Confirmed | None:
    """`{"announced":{...},"seq":18,"epoch":"5f3a09c1","sig":"..."}`: what is signed is the announcement as it is written."""
    head = '{"announced":'
    try:
        told: Any = jsontext.read(text, jsontext.ANSWER_DEPTH) if text.startswith(head) else None
        _, end = jsontext.read_first(text, len(head))
    except jsontext.Invalid:
        return None
    announced, seq, epoch, sig = (told.get(key) for key in ("announced", "seq", "epoch", "sig"))
    if not isinstance(announced, dict) or announced.get("node", publisher) != publisher or not isinstance(seq, int) or \
            not isinstance(epoch, str) or not isinstance(sig, str) or \
            not is_update_signed(fleet, publisher, noun, seq, epoch, text[len(head):end], sig):
        return None
    signed = announced.get("signed", [])
    return _Confirmed(epoch, frozenset(each for each in signed if isinstance(each, str)) if isinstance(signed, list) else
                      frozenset())
