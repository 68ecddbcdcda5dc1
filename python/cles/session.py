# SPDX-License-Identifier: BSL-1.0
"""One link of a node: lines in, lines and outcomes out, requests in both directions. No I/O."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from . import grammar, jsontext
from .asking import Asking
from .core import Core, Peer
from .datagrams import Remembered
from .errors import Error, failure_of
from .following import Subscriptions
from .grammar import Malformed, Request
from .reserved import Reserved
from .serving import Serving


class Carrier(Protocol):
    """What carries the lines of a session."""

    def wake(self) -> None:
        """There are lines to be sent, or requests to go on with (`Session.serve_more`)."""

    def finish(self) -> None:
        """Ends the link when the lines have been sent."""

    def close(self) -> None:
        """Ends the link now."""

    def pause(self, stop: bool) -> None:
        """Stops reading, or reads again."""

    def retire(self) -> None:
        """The peer takes no new requests."""

    def unsent(self) -> int:
        """How many bytes the peer has not read yet."""


class Confirms(Protocol):
    """Of a secured link: which updates are believed (`Confirmation`)."""

    def admits(self, update: Request) -> bool: ...

    def may_take_value(self, publisher: str, task: str) -> bool: ...


_UNSENT_UPDATES = 65_536  # bytes; beyond, updates wait in their bindings


class Session:
    def __init__(self, core: Core, carrier: Carrier, peer: Peer, *, by_datagram: bool = False, first_id: int = 1) -> None:
        self.core = core
        self.peer = peer
        self.account = core.budget.account()
        self.output: list[str] = []  # lines without LF; the carrier takes them
        self.subscriptions = Subscriptions()
        self._carrier = carrier
        self._by_datagram = by_datagram
        longest = grammar.DATAGRAM - 1 if by_datagram else core.limits.line
        self.reserved = Reserved(core, longest, by_datagram=by_datagram)
        self.serving = Serving(core, self, peer, Remembered(core) if by_datagram else None)
        self.asking = Asking(core, self, by_datagram=by_datagram, first_id=first_id)
        # Of a secured link: the peer has another roster; whether an update is believed, and the value in a reply to BIND.
        self.on_hello: Callable[[str], None] | None = None
        self.confirmation: Confirms | None = None
        self._unflushed = 0  # bytes of updates in `output`
        self._holds_back = False  # updates, in their bindings
        self._closed = False
        self._may_be_refused = True
        self._refusal: Error | None = None

    # --- From the carrier ---

    def on_line(self, line: str, now: int) -> None:
        line = grammar.trim(line)
        if not line or self._closed:
            return
        if self._by_datagram and "\n" in line:
            if not any(grammar.is_http(grammar.trim(each)) for each in line.split("\n")):
                self._refuse(line, "a datagram must contain one line")
            return
        if self._may_be_refused or self._refusal:
            self._note_refusal(line)
        if grammar.is_reply(line):
            self._on_reply(line)
        elif grammar.is_http(line):
            if not self._by_datagram:  # web pages send no datagrams
                self.on_lost("the peer speaks HTTP")
                self._carrier.close()
        else:
            try:
                request = grammar.parse_request(line)
            except Malformed as error:
                self.serving.on_malformed(grammar.salvage(line), str(error))
                return
            if request.is_update:
                self._on_update(request)
            elif self.on_hello is not None and _is_link_notice(request, "hello"):
                self.on_hello(request.body)
            elif _is_link_notice(request, "leaving") and not self._by_datagram:
                self._carrier.retire()
                self.asking.lose(Error("busy", "the node there is leaving, and has not started this request", retry_ms=1000))
            else:
                self.serving.on_request(request, now)

    def on_overlong(self, head: str) -> None:
        """A line over the limit; `head` is what has arrived of it."""
        self._may_be_refused = False
        head = grammar.trim(head)
        if not grammar.is_reply(head):
            self.serving.on_overlong(head)
            return
        self.core.count("replies_dropped")
        if self._by_datagram:
            return
        id = grammar.salvage("PULL " + head).id
        if id:
            self.asking.on_overlong(id)
        self._closed = True
        self._carrier.finish()

    def on_cut(self, rest: str) -> None:
        """The stream has ended within this line. It may be incomplete, so it is not executed."""
        rest = grammar.trim(rest)
        if rest and not self._closed:
            self._refuse(rest, "the last line does not end with LF")

    def on_end(self) -> None:
        """The peer has ended its stream."""
        self.serving.end()
        self._lose_requests("the peer ended the link before it answered")

    def on_lost(self, why: str) -> None:
        self._closed = True
        self.serving.lose()
        self._lose_requests(why)

    def on_writable(self, now: int) -> None:
        self._holds_back = False
        self.serving.drain(now)

    def serve_more(self, now: int) -> None:
        self.serving.serve_more(now)

    def take_output(self) -> list[str]:
        output, self.output = self.output, []
        self._unflushed = 0
        return output

    def resume_updates(self, now: int) -> None:
        """After output was taken: puts more of the updates that wait in their bindings."""
        if self._holds_back and self._carrier.unsent() < _UNSENT_UPDATES:
            self.on_writable(now)

    def send_leave_notice(self) -> None:
        """The last line of a node that leaves."""
        if not self._closed and not self._by_datagram:
            self._closed = True
            self.put(grammar.request_line("PUSH", "self:cles/leaving", wants_reply=False))
            self._carrier.finish()

    # --- Lines ---

    def _refuse(self, text: str, why: str) -> None:
        if grammar.is_reply(text):
            self.core.count("replies_dropped")
        else:  # the id for the reply is in the first line
            self.serving.on_malformed(grammar.salvage(grammar.trim(text.partition("\n")[0])), why)

    def _note_refusal(self, line: str) -> None:
        """`busy` without id refuses the link, if it is the only line that ever arrives."""
        first, self._may_be_refused = self._may_be_refused, False
        self._refusal = None
        if first and grammar.is_failure(line):
            try:
                error = failure_of(jsontext.read(line))
            except jsontext.Invalid:
                return
            if error.code == "busy" and not error.ran:
                self._refusal = error

    def _lose_requests(self, why: str) -> None:
        self.asking.end(self._refusal or Error("unavailable", why))

    def _on_reply(self, line: str) -> None:
        reply = grammar.parse_reply(line)
        if reply is None or not self.asking.on_reply(reply):
            self.core.count("replies_dropped")

    def _on_update(self, update: Request) -> None:
        subscription = self.subscriptions.find(update)
        if subscription is None or self.confirmation is None or self.confirmation.admits(update):
            self.deliver(update)

    def deliver(self, update: Request) -> None:
        subscription = self.subscriptions.find(update)
        if subscription is not None:
            try:
                value = jsontext.read(update.body, jsontext.ANSWER_DEPTH) if update.body else {}
            except jsontext.Invalid:
                value = {"error": ""}
            if not jsontext.begins_with_error(value) and \
                    subscription.take(update.noun.target, update.epoch, update.seq, value):
                return
        self.core.count("updates_dropped")

    # --- For what serves and asks ---

    def put(self, line: str) -> None:
        self.output.append(line)

    def put_update(self, line: str) -> None:
        if self._by_datagram and len(line.encode()) >= grammar.DATAGRAM:
            self.core.count("updates_too_large")
            return
        self._unflushed += len(line)
        self.put(line)
        self._carrier.wake()

    def takes_updates(self) -> bool:
        if self._carrier.unsent() + self._unflushed < _UNSENT_UPDATES:
            return True
        self._holds_back = True
        return False

    def is_behind(self) -> bool:
        return self._carrier.unsent() > self.core.limits.unread

    def wake(self) -> None:
        self._carrier.wake()

    def finish(self) -> None:
        self._carrier.finish()

    def pause(self, stop: bool) -> None:
        self._carrier.pause(stop)


def _is_link_notice(r: Request, what: str) -> bool:
    """Whether it is a line about the link, which is not answered."""
    return r.verb == "PUSH" and not r.wants_reply and r.noun.target == "self" and r.noun.path == f"cles/{what}"
