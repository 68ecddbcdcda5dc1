# SPDX-License-Identifier: BSL-1.0
"""How functions of a program become handlers of a node."""

from __future__ import annotations

import asyncio
import inspect
import logging
from collections.abc import Callable, Coroutine
from typing import Any, get_type_hints

from . import jsontext
from .core import Core, Peer, Task
from .errors import ConversionError, Error
from .grammar import Trace, Verb
from .schemas import check_told, content_schema
from .serving import Call
from .types import from_json, to_json

log = logging.getLogger("cles")


class Request:
    """What a handler serves."""

    __slots__ = ("_call", "_core")

    def __init__(self, call: Call, core: Core) -> None:
        self._call = call
        self._core = core

    @property
    def verb(self) -> Verb:
        return self._call.request.verb

    @property
    def task(self) -> str:
        return self._call.request.noun.task

    @property
    def path(self) -> str:
        """The task and its parameters, as nodes write them: `tyre/front%20left`."""
        return self._call.request.noun.path

    @property
    def parameters(self) -> tuple[str, ...]:
        """Those after the task, decoded."""
        return self._call.request.noun.parameters

    @property
    def body(self) -> Any:
        return self._call.value

    @property
    def peer(self) -> Peer | None:
        """Who is at the other end of the link. None: it is gone."""
        return self._call.peer

    @property
    def requester(self) -> str:
        """In a secured fleet, the member whose request it is."""
        return self._call.requester

    @property
    def forwarded_by(self) -> str:
        """In a secured fleet, the member that has forwarded it for the requester: the peer. Otherwise empty."""
        return self._call.forwarded_by

    @property
    def seconds_left(self) -> float:
        return max(self._call.due - self._core.now(), 0) / 1e9

    @property
    def trace(self) -> Trace | None:
        """For `trace=` of the requests that the handler sends."""
        return self._call.trace

    @property
    def stopped(self) -> bool:
        """Whether nobody waits for the result any more."""
        return self._call.stopped

    def progress(self, fraction: float, value: Any = None) -> bool:
        """An interim reply to a DELEGATE. False: the requester wants none."""
        return self._call.progress(fraction, "" if value is None else written(value))


def written(value: Any) -> str:
    try:
        return jsontext.write(value, to_json)
    except (ConversionError, jsontext.Invalid) as error:
        raise Error("failed", f"the result cannot be sent: {error}") from None


class _Shape:
    """Which arguments a function takes: the request, the body as a type, both, or none."""

    def __init__(self, function: Callable[..., Any]) -> None:
        parameters = [each for each in inspect.signature(function).parameters.values()
                      if each.default is each.empty and each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]
        hints = get_type_hints(function, include_extras=True)
        annotated = [hints.get(each.name, inspect.Parameter.empty) for each in parameters]
        empty = inspect.Parameter.empty
        self.takes_request = bool(annotated) and annotated[0] in (Request, empty)
        rest = annotated[1:] if self.takes_request else annotated
        if len(rest) > 1:
            raise TypeError("a handler takes the request, the body, both in this order, or nothing")
        self.takes_body = bool(rest)
        self.body: Any = rest[0] if rest and rest[0] is not empty else Any
        self.result: Any = hints.get("return", empty)


def make_task(core: Core, verb: Verb, function: Callable[..., Any], tasks: set[asyncio.Task[None]], description: str,
              parameters: tuple[str, ...], idempotent: bool) -> Task:
    """`tasks` holds the coroutines that run."""
    shape = _Shape(function)
    if shape.takes_body and verb in ("PULL", "BIND"):
        raise TypeError(f"{verb} has no body")

    def arguments(call: Call) -> list[Any]:
        given: list[Any] = [Request(call, core)] if shape.takes_request else []
        if shape.takes_body:
            try:
                given.append(call.value if shape.body is Any else from_json(call.value, shape.body, is_content=True))
            except ConversionError as error:
                raise Error("bad_request", str(error)) from None
        return given

    def run(call: Call) -> None:
        try:
            call.done(written(result) if (result := function(*arguments(call))) is not None else "")
        except Exception as error:  # whatever the handler throws is the reply
            call.fail(described(error))

    def start(call: Call) -> None:
        try:
            running = asyncio.ensure_future(_run_later(call, function(*arguments(call))))
        except Exception as error:
            call.fail(described(error))
            return
        tasks.add(running)
        running.add_done_callback(tasks.discard)
        call.on_stop(lambda: None if running.cancel() else None)

    types: dict[str, Any] = {}
    if verb in ("PUSH", "DELEGATE", "UPDATE") and shape.body is not Any:
        types["body"] = content_schema(shape.body)
    if verb != "BIND" and shape.result is not inspect.Parameter.empty:
        types["result"] = content_schema(shape.result)
    types = {part: schema for part, schema in types.items() if schema}
    if verb == "UPDATE" and "body" in types:
        types["updates"] = types["body"]
    if parameters:
        types["parameters"] = {"type": "array", "prefixItems": [{"type": "string", "title": each} for each in parameters]}
    is_async = inspect.iscoroutinefunction(function)
    return Task(start if is_async else run, description or _first_line(function), parameters, idempotent,
                check_told(types))


async def _run_later(call: Call, work: Coroutine[Any, Any, Any]) -> None:
    try:
        result = await work
        call.done(written(result) if result is not None else "")
    except asyncio.CancelledError:
        call.fail(Error("cancelled", "the handler was cancelled"))
        if not call.stopped:
            raise
    except Exception as error:
        call.fail(described(error))


def _first_line(function: Callable[..., Any]) -> str:
    return (inspect.getdoc(function) or "").partition("\n")[0]


def described(error: Exception) -> Error:
    if isinstance(error, Error):
        return error
    if not isinstance(error, ConversionError):
        log.warning("a handler failed: %s: %s", type(error).__name__, error)
    # A message never names a file.
    text = error.strerror if isinstance(error, OSError) else str(error)
    return Error("failed", text or type(error).__name__)
