# SPDX-License-Identifier: BSL-1.0
"""The requests of the node at the other end of a link: whether they run now, later or not, and their replies."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from . import grammar, jsontext
from .core import Access, Core, Peer, Task
from .datagrams import Remembered
from .errors import DEFAULT_RETRY_MS, Error
from .grammar import Request, Salvaged, Trace
from .limits import Account
from .timers import MS, Timer

if TYPE_CHECKING:
    from .session import Session

_AROUND_A_CALL = 512  # bytes
_REQUESTS_A_TURN = 256
_AFTER_RUN = ("too_large", "no_target", "no_task")


def failure_text(error: Error, node: str) -> str:
    message = error.message if error.message.startswith(node) else f"{node}: {error.message}"
    failure: dict[str, Any] = {"error": error.code, "message": message.encode("utf-8", "replace").decode()}
    if error.ran:
        failure["ran"] = True
    if error.retry_ms is not None or error.code == "busy":
        failure["retry_ms"] = DEFAULT_RETRY_MS if error.retry_ms is None else error.retry_ms
    return jsontext.write(failure)


class Call:
    """A request that a handler has received. It ends once: with `done` or `fail`, or because it is withdrawn."""

    __slots__ = ("_arrived", "_began", "_memory", "_on_stop", "_owner", "_reported", "_span", "_timer", "due", "forwarded_by",
                 "request", "requester", "stopped", "trace", "value")

    def __init__(self, owner: Serving, request: Request, value: Any, due: int, trace: Trace | None, by: Access) -> None:
        self._owner: Serving | None = owner
        self.request = request
        self.value = value  # of the body
        self.due = due
        self.trace = trace
        self.requester = by.requester
        self.forwarded_by = by.forwarded_by
        self.stopped = False
        self._span = trace.span if trace is not None and trace.recorded else ""
        self._began = owner.core.now()
        self._memory = 0
        self._on_stop: Callable[[], None] | None = None
        self._reported = 0.0
        self._timer: Timer | None = None

    @property
    def peer(self) -> Peer | None:
        return self._owner.peer if self._owner else None

    @property
    def ended(self) -> bool:
        return self._owner is None

    def done(self, text: str = "", head: str = "") -> None:
        """`text` is the JSON of the result."""
        owner = self._owner
        if owner is None:
            return
        if self.request.verb == "UPDATE":
            self._publish(owner, text)
            return
        self._end()
        owner.answer(self.request, text, head, self._span)
        owner.forget(self)

    def _publish(self, owner: Serving, text: str) -> None:
        """The reply comes first, and no update if it is a failure."""
        path, core = self.request.noun.path, owner.core
        self._end()
        try:
            body = jsontext.write(self.value)
            core.topics.prepare(path, body)
        except (Error, jsontext.Invalid) as error:
            code, why = (error.code, error.message) if isinstance(error, Error) else ("failed", str(error))
            owner.refuse(self.request, Error(code, why, ran=True), self._span)
        else:
            owner.answer(self.request, text, "", self._span)
            core.topics.commit(path, body, core.now())
        owner.forget(self)

    def fail(self, error: Error) -> None:
        owner = self._owner
        if owner is None:
            return
        if error.code in _AFTER_RUN and not error.ran:
            error = Error(error.code, error.message, ran=True, retry_ms=error.retry_ms)
        self._end()
        owner.refuse(self.request, error, self._span)
        owner.forget(self)

    def progress(self, fraction: float, text: str = "") -> bool:
        """False: nobody wants it."""
        if self._owner is None or not self.request.progress or not self.request.id:
            return False
        self._reported = max(self._reported, min(max(fraction, 0.0), 1.0))
        self._owner.report(self.request.id, self._reported, text)
        return True

    def on_stop(self, callback: Callable[[], None]) -> None:
        """Called when nobody waits for the result any more."""
        if self.stopped:
            callback()
        elif self._owner is not None:
            self._on_stop = callback

    # For `Serving`.

    def keep(self) -> bool:
        """The handler replies later. False: there is no memory for that."""
        assert self._owner is not None
        self._memory = len(self.request.text) + _AROUND_A_CALL
        if not self._owner.account.try_hold(self._memory):
            self._memory = 0
            return False
        self._owner.core.running += 1
        return True

    def watch(self) -> None:
        if self._owner is not None:
            self._timer = self._owner.core.timers.at(self.due, self._on_due)

    def _on_due(self, _: int) -> None:
        self._timer = None
        if self._owner is not None:
            self.abort(Error("deadline", f"{self._owner.core.name} did not finish in time"))

    def abort(self, error: Error) -> None:
        self.fail(error)
        self.stop()

    def detach(self) -> None:
        """The link is gone."""
        owner = self._owner
        if owner is not None:
            self._end()
            if self._span:
                owner.core.spans.end(self._span, "cancelled", owner.core.now())

    def _end(self) -> None:
        owner, self._owner = self._owner, None
        assert owner is not None
        if self._timer is not None:
            self._timer.cancel()
        if self._memory:
            owner.account.release(self._memory)
            owner.core.running -= 1
        if self._span:
            owner.core.spans.ran(self._span, owner.core.now() - self._began)

    def stop(self) -> None:
        self.stopped = True
        callback, self._on_stop = self._on_stop, None
        if callback is not None:
            callback()


class BindCall(Call):
    """Of a BIND: when its handler is done, the link is bound, and the reply is the last update."""

    __slots__ = ()

    def done(self, text: str = "", head: str = "") -> None:
        if self._owner is None:
            return
        try:
            text, head = self._owner.bind(self.request)
        except Error as error:
            self.fail(error)
        else:
            super().done(text, head)


class Serving:
    def __init__(self, core: Core, session: Session, peer: Peer, remembered: Remembered | None) -> None:
        self.core = core
        self.peer = peer
        self.account: Account = session.account
        self._session = session
        self._remembered = remembered
        self._longest = core.limits.line if remembered is None else min(core.limits.line, grammar.DATAGRAM - 1)
        self._calls: dict[int, Call] = {}
        self._running: Call | None = None  # without id
        self._waiting: deque[tuple[Request, int] | str] = deque()  # a request and its arrival, or a reply in its turn
        self._waiting_bytes = 0
        self._paused = False
        self._is_serving = False
        self._bound: dict[str, Timer | None] = {}  # paths, and when the lease ends
        self._binding: list[tuple[str, Call]] = []  # whose handlers have not decided yet
        self._ending = False
        self._closing = False
        self._finished = False
        self._lost = False

    # --- Requests that arrive ---

    def on_request(self, r: Request, now: int) -> None:
        if self._ending:
            return
        if self._remembered is not None and not self._admits_datagram(r, self._remembered):
            return
        self.core.requests[r.verb] += 1
        if r.id and r.id in self._calls:
            self.refuse(r, Error("bad_request", f"the id {r.id} is in flight already"))
            self._break_off()
            return
        noun = r.noun
        if r.verb == "PUSH" and noun.task == "cles" and len(noun.parameters) == 2 and noun.parameters[0] == "cancel":
            id = grammar.number_between(noun.parameters[1], 1, grammar.MAX_ID)
            if id:
                self._cancel(r, id)
                return
        if self.core.leaving:
            self._refuse_in_turn(r.id, r.wants_reply, _leaving(self.core.name))
        elif not r.id and self._must_wait():
            self._wait(r, now)
        elif self._in_flight() >= self.core.limits.in_flight and not (r.verb == "BIND" and r.lease == 0):
            self.refuse(r, Error("busy", "too many requests are in flight on this link"))
        else:
            self._serve(r, now, now)

    def _wait(self, r: Request, now: int) -> None:
        size = len(r.text)
        if self._in_flight() >= self.core.limits.in_flight:
            self._refuse_in_turn(0, r.wants_reply, Error("busy", "too many requests wait on this link"))
        elif r.noun.task != "cles" and not self.account.try_hold(size):
            self._refuse_in_turn(0, r.wants_reply, Error("busy", "no memory is left for this link (limits.memory)"))
        else:
            if r.noun.task == "cles":
                self.account.hold(size)
            self._waiting.append((r, now))
            self._count_waiting(size)

    def on_malformed(self, what: Salvaged, why: str) -> None:
        if self._ending:
            return
        self._refuse_in_turn(what.id, what.wants_reply, Error("bad_request", why))
        if self._remembered is None and what.id in self._calls:
            self._break_off()

    def on_overlong(self, head: str) -> None:
        if self._ending:
            return
        what = grammar.salvage(head)
        longest = f"a line has at most {self.core.limits.line} bytes (limits.line)"
        if self._remembered is not None:
            longest = f"a datagram has at most {grammar.DATAGRAM} bytes: use TCP"
        self._refuse_in_turn(what.id, what.wants_reply, Error("too_large", longest))
        if self._remembered is None:
            self._closing = True
            self.end()

    def end(self) -> None:
        """The peer has ended its stream, and with it what it has asked with an `id`."""
        self._ending = True
        for id in list(self._calls):
            self._withdraw(id)
        self._finish_if_done()

    def _break_off(self) -> None:
        self.lose()
        self._ending = self._closing = True
        self._finish_if_done()

    def lose(self) -> None:
        self._lost = True
        calls = [*([self._running] if self._running else []), *self._calls.values()]
        self._calls, self._running = {}, None
        self._waiting.clear()
        self.account.release(self._waiting_bytes)
        self._waiting_bytes = 0
        for call in calls:
            call.detach()
        for path in list(self._bound):
            self._unbind(path)
        for call in calls:
            call.stop()

    def abort_running(self) -> None:
        """The node ends: what still runs, and what waits, is answered now."""
        for call in [*self._calls.values(), *([self._running] if self._running else [])]:
            call.abort(Error("unavailable", f"{self.core.name} shut down before the request had ended"))
        while self._waiting and not self._is_serving:
            self.serve_more(self.core.now())

    def _finish_if_done(self) -> None:
        if self._ending and not self._finished and not self._must_wait() and (self._closing or not self._bound):
            self._finished = True
            self._session.finish()

    @property
    def is_idle(self) -> bool:
        return not self._in_flight() and not self._bound and (self._remembered is None or not self._remembered)

    # --- Those without an id run one after another ---

    def _in_flight(self) -> int:
        return len(self._calls) + len(self._waiting) + (1 if self._running else 0)

    @property
    def in_flight(self) -> int:
        return self._in_flight()

    def _must_wait(self) -> bool:
        return self._running is not None or bool(self._waiting)

    def _refuse_in_turn(self, id: int, wanted: bool, error: Error) -> None:
        if id or not wanted or not self._must_wait():
            self._fail(id, wanted, error)
        else:
            self._put_in_turn(failure_text(error, self.core.name))

    def _put_in_turn(self, reply: str) -> None:
        self.account.hold(len(reply))
        self._waiting.append(reply)
        self._count_waiting(len(reply))

    def _count_waiting(self, size: int) -> None:
        self._waiting_bytes += size
        most = self.core.limits.waiting
        too_much = self._waiting_bytes > (most // 2 if self._paused else most)
        if too_much != self._paused:
            self._paused = too_much
            self._session.pause(too_much)

    def serve_more(self, now: int) -> None:
        """Goes on with the requests that wait for their turn."""
        if self._is_serving:
            return
        self._is_serving = True
        try:
            for _ in range(_REQUESTS_A_TURN):
                if not self._waiting or self._running is not None:
                    break
                next = self._waiting.popleft()
                size = len(next) if isinstance(next, str) else len(next[0].text)
                self.account.release(size)
                self._count_waiting(-size)
                if isinstance(next, str):
                    self._session.put(next)
                else:
                    self._serve(next[0], next[1], now)
            else:
                self._session.wake()
        finally:
            self._is_serving = False
        self._finish_if_done()

    # --- Serving ---

    def _serve(self, r: Request, arrived: int, now: int) -> None:
        trace = r.trace
        span = ""
        if trace is not None and trace.recorded:
            trace = self.core.spans.receive(r, arrived, now)
            span = trace.span
        due = arrived + r.deadline_ms * MS
        try:
            if now >= due:
                raise Error("deadline", "the deadline passed while the request was queued")
            if self.core.leaving:
                raise _leaving(self.core.name)
            value = self._check(r)
            if r.noun.task == "cles":
                self.answer(r, self._session.reserved.serve(r, self.peer), span=span)
                return
            if r.verb == "BIND":
                self._serve_bind(r, due, trace, span)
                return
            entry = self.core.tasks.get(r.noun.task, {}).get(r.verb)
            if entry is None:
                raise Error("no_task", f"{self.core.name} has no {r.verb} '{r.noun.task}'")
            if r.verb == "UPDATE" and not self.core.topics.can_publish(r.noun.path):
                raise Error("busy", f"'{r.noun.task}' has reached its limit of nouns")
            self._start(entry, Call(self, r, value, due, trace, self.core.access(self.peer, r)))
        except Error as error:
            self.refuse(r, error, span)

    def _check(self, r: Request) -> Any:
        """The value of the body, of a request that may be served here."""
        core = self.core
        if core.security is not None:
            denied = core.security.refusal(self.peer, r)
            if denied is not None:
                raise denied
        if core.authorise is not None and not core.authorise(core.access(self.peer, r)):
            raise Error("denied", f"{core.name} does not allow {r.verb} {grammar.quoted(r.noun.path)}")
        if r.noun.target not in ("self", core.name):
            raise Error("no_target", f"{core.name} does not route, and cannot forward a request to "
                                     f"{grammar.quoted(r.noun.target)}: ask that node itself, or a node that routes")
        if core.name in r.via:
            raise Error("no_target", f"{core.name} has forwarded this request before: the nodes in 'via' form a loop")
        if not r.body:
            return {}
        try:
            value = jsontext.read(r.body, core.limits.depth)
        except jsontext.Invalid as error:
            raise Error("bad_request", f"the body is not valid JSON: {error}") from None
        if r.verb == "UPDATE" and jsontext.begins_with_error(value):
            raise Error("bad_request", "an update's first key cannot be 'error'")
        return value

    def _start(self, entry: Task, call: Call) -> None:
        """Runs a handler, which may end the call at once."""
        if self.core.running >= self.core.limits.running:
            raise Error("busy", f"{self.core.name} has reached its limit of running handlers")
        if not call.keep():
            raise Error("busy", "no memory is left for this link or for all links (limits.memory)")
        r = call.request
        if r.id:
            self._calls[r.id] = call
            if self._remembered is not None and r.verb in ("PULL", "BIND"):
                self._remembered.add_repeatable(r.id, r.text)
        else:
            self._running = call
        entry.start(call)
        call.watch()

    def forget(self, call: Call) -> None:
        self._session.wake()
        if call.request.id:
            self._calls.pop(call.request.id, None)
        elif self._running is call:
            self._running = None
            self.serve_more(self.core.now())
        self._finish_if_done()

    def _cancel(self, r: Request, id: int) -> None:
        """Takes effect at once, however much is in flight. Without an id, the reply still waits for its turn."""
        try:
            self._check(r)
        except Error as error:
            self._refuse_in_turn(r.id, r.wants_reply, error)
            return
        self._withdraw(id)
        if r.id or not r.wants_reply or not self._must_wait():
            self.answer(r, "{}")
        else:
            self._put_in_turn("{}")

    def _withdraw(self, id: int) -> None:
        call = self._calls.get(id)
        if call is not None:
            call.abort(Error("cancelled", "the requester cancelled it"))

    # --- BIND ---

    def _serve_bind(self, r: Request, due: int, trace: Trace | None, span: str) -> None:
        task, path = r.noun.task, r.noun.path
        if r.lease == 0:
            self._unbind(path)
            self.answer(r, "{}", span=span)
            for asked, call in list(self._binding):
                if asked == path:
                    call.abort(Error("cancelled", "it was unbound"))
            self._finish_if_done()
            return
        entry = self.core.tasks.get(task, {}).get("BIND")
        if entry is None and not self.core.can_bind(task):
            raise Error("no_task", f"{self.core.name} has no BIND '{task}'")
        if entry is None:
            self._bind(r, span)
            return
        call = BindCall(self, r, {}, due, trace, self.core.access(self.peer, r))
        self._binding = [each for each in self._binding if not each[1].ended]
        self._binding.append((path, call))
        self._start(entry, call)

    def _bind(self, r: Request, span: str) -> None:
        reply, head = self.bind(r)
        self.answer(r, reply, head, span)

    def bind(self, r: Request) -> tuple[str, str]:
        """Binds; returns the reply and its head."""
        path = r.noun.path
        if path not in self._bound and len(self._bound) >= self.core.limits.bindings:
            raise Error("busy", "too many bindings on this link")
        topic = self.core.topics.open(path)
        self.core.topics.bind(topic, self._session, r.every, r.keep)
        timer = self._bound.get(path)
        if timer is not None:
            timer.cancel()
        lease = None
        if self._remembered is not None:
            end = self.core.now() + (grammar.DEFAULT_LEASE_MS if r.lease is None else r.lease) * MS
            lease = self.core.timers.at(end, lambda _: self._unbind(path))
        self._bound[path] = lease
        return topic.last, topic.mark if r.mark and r.id else ""

    def _unbind(self, path: str) -> None:
        if path in self._bound:
            timer = self._bound.pop(path)
            if timer is not None:
                timer.cancel()
            self.core.topics.unbind(path, self._session)

    def drain(self, now: int) -> None:
        for path in self._bound:
            self.core.topics.drain(path, self._session, now)

    def drop_forbidden_bindings(self) -> None:
        """After a change of rights."""
        for path in list(self._bound):
            r = Request("BIND", grammar.parse_noun(f"self:{path}"))
            if self.core.security is not None and self.core.security.refusal(self.peer, r) is not None:
                self._unbind(path)

    # --- Datagrams ---

    def _admits_datagram(self, r: Request, known: Remembered) -> bool:
        needs_id = r.verb not in ("PULL", "BIND")
        if not r.id:
            if needs_id:
                self.refuse(r, Error("bad_request", f"by datagram, {r.verb} needs an 'id'"))
            return not needs_id
        verdict = known.look(r.id, r.text)
        if verdict == "answered":
            for line in known.reply(r.id, r.text):
                self._session.put(line)
        elif verdict == "clash":
            self._session.put(f"id={r.id} " + failure_text(
                Error("bad_request", f"the id {r.id} is in flight with another request"), self.core.name))
        elif verdict == "fresh":
            if not needs_id or r.noun.task == "cles" or known.begin(r.id, r.text):
                return True
            self.refuse(r, Error("busy", f"{self.core.name} has reached its limit of requests by datagram",
                                 retry_ms=1000))
        return False

    # --- Replies ---

    def answer(self, r: Request, text: str, head: str = "", span: str = "") -> None:
        body = jsontext.enclosed(text)
        if body.startswith('{"error":'):
            self.refuse(r, Error("failed", "the result's first key is 'error'"), span)
            return
        line = f"id={r.id} {head + ' ' if head else ''}{body}" if r.id else body
        size = len(line) if line.isascii() else len(line.encode())
        if size > self._longest:
            limit = f"{self._longest} by datagram: use TCP" if self._remembered is not None else \
                f"{self._longest} (limits.line)"
            self.refuse(r, Error("too_large", f"the answer has {size} bytes, the limit is {limit}", ran=True), span)
            return
        if span:
            self.core.spans.end(span, "ok", self.core.now())
        if r.wants_reply:
            self._session.put(line)
        if self._remembered is not None and r.id:
            self._remembered.set_reply(r.id, line if r.wants_reply else "", self.core.now())

    def refuse(self, r: Request, error: Error, span: str = "") -> None:
        if span:
            self.core.spans.end(span, error.code, self.core.now())
        line = self._fail(r.id, r.wants_reply, error)
        if self._remembered is not None and r.id:
            self._remembered.set_reply(r.id, line, self.core.now())

    def _fail(self, id: int, wanted: bool, error: Error) -> str:
        self.core.count("errors" if wanted else "errors_unsent")
        if not wanted:
            return ""
        text = failure_text(error, self.core.name)
        line = f"id={id} {text}" if id else text
        if len(line.encode()) > self._longest:  # a handler's message may be long
            short = Error(error.code, error.message[:max(self._longest // 6 - 64, 0)], ran=error.ran, retry_ms=error.retry_ms)
            text = failure_text(short, self.core.name)
            line = f"id={id} {text}" if id else text
        self._session.put(line)
        return line

    def report(self, id: int, fraction: float, text: str) -> None:
        if not self._session.is_behind():  # else the next report replaces it
            self._session.put(f"id={id} progress={fraction:.6g} {jsontext.enclosed(text)}")
            self._session.wake()


def _leaving(node: str) -> Error:
    return Error("busy", f"{node} is shutting down", retry_ms=1000)
