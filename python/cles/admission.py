# SPDX-License-Identifier: BSL-1.0
"""How both ends of a `tls` link learn that they are members of one fleet (docs/protocol_security.md, "Streams"). No I/O."""

from __future__ import annotations

import asyncio
import ssl
from typing import Any

from . import grammar, jsontext
from .errors import Error, RefusedError, failure_of
from .fleet import LONGEST_ROSTER, Fleet, key_in_certificate
from .grammar import Malformed
from .serving import failure_text

_LONGEST_SHORT_LINE = 1024  # bytes, of any line but the roster's
_ROSTER = "PUSH self:cles/roster reply=no "
LONGEST_LINE = len(_ROSTER) + LONGEST_ROSTER
_WELCOME = "PUSH self:cles/welcome reply=no\n"


class Admission:
    """Either `admitted`, with the `name` of the other end, or `refused`, with the reason, or not decided yet."""

    def __init__(self, fleet: Fleet, epoch: str, expected: str) -> None:
        self._fleet = fleet
        self._epoch = epoch
        self._expected = expected
        self._key = b""
        self._stated = 0
        self._stage = "hello"
        self.admitted = False
        self.refused = ""
        self.name = ""
        self.peer_epoch = ""

    def begin(self, transport: asyncio.Transport) -> str:
        """The handshake is complete. What is returned here and below is sent."""
        session: ssl.SSLObject = transport.get_extra_info("ssl_object")
        certificate = session.getpeercert(binary_form=True)
        if session.selected_alpn_protocol() != "cles/1" or not certificate:
            return self._refuse("the other end does not speak this protocol")
        try:
            return self.begin_with(key_in_certificate(certificate))
        except RefusedError as error:
            return self._refuse(str(error))

    def begin_with(self, key: bytes) -> str:
        """`key`: that the other end has proved to have."""
        self._key = key
        self._stated = self._fleet.version
        return f'PUSH self:cles/hello reply=no {{"version":{self._stated},"epoch":"{self._epoch}"}}\n'

    @property
    def longest_line(self) -> int:
        return LONGEST_LINE if self._stage == "roster" else _LONGEST_SHORT_LINE

    def _refuse(self, why: str, tell: str = "") -> str:
        self.refused = why
        return failure_text(Error("denied", tell), self._fleet.name) + "\n" if tell else ""

    def on_line(self, line: str) -> str:
        line = grammar.trim(line)
        if grammar.is_failure(line):
            return self._refuse(f"the other end refused the link: {_message(line)}")
        try:
            r = grammar.parse_request(line)
        except Malformed:
            return self._refuse("the other end sent another line before its welcome")
        if r.verb != "PUSH" or r.wants_reply or r.id or r.noun.target != "self" or r.noun.path != f"cles/{self._stage}":
            return self._refuse("the other end sent another line before its welcome")
        if self._stage == "hello":
            return self._on_hello(r.body)
        if self._stage == "roster":
            try:
                self._fleet.offer(r.body)
            except RefusedError as error:
                return self._refuse(f"the other end's roster was refused: {error}", f"the roster was refused: {error}")
            return self._look_up()
        self.admitted = self._find() == self.name
        return "" if self.admitted else self._refuse("a member was removed while the link was opened")

    def _on_hello(self, body: str) -> str:
        try:
            told: Any = jsontext.read(body)
        except jsontext.Invalid:
            told = None
        version, epoch = (told.get("version"), told.get("epoch")) if isinstance(told, dict) else (None, None)
        if not isinstance(version, int) or isinstance(version, bool) or not 1 <= version < 2**32 or \
                not isinstance(epoch, str) or len(epoch) != 8 or epoch.strip("0123456789abcdef"):
            return self._refuse("the other end's hello is malformed")
        self.peer_epoch = epoch
        if version > self._stated:
            self._stage = "roster"
            return ""
        roster = f"{_ROSTER}{self._fleet.roster.line}\n" if version < self._stated and self._find() else ""
        return roster + self._look_up()

    def _find(self) -> str:
        member = self._fleet.roster.by_key.get(self._key)
        return member.name if member else ""

    def _look_up(self) -> str:
        found = self._find()
        if not found:
            return self._refuse(f"the other end's key is not in roster {self._fleet.version}",
                                f"the key of this node is not in roster {self._fleet.version}")
        if self._expected and found != self._expected:
            return self._refuse(f"the other end is {found}, not {self._expected}")
        self.name = found
        self._stage = "welcome"
        return _WELCOME


def _message(line: str) -> str:
    try:
        return failure_of(jsontext.read(line)).message[:200]
    except jsontext.Invalid:
        return ""
