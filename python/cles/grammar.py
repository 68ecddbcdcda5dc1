# SPDX-License-Identifier: BSL-1.0
"""Lines: requests, replies and their parts (docs/protocol.md, "The line")."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Final, Literal, get_args
from urllib.parse import quote, unquote_to_bytes

Verb = Literal["PULL", "PUSH", "DELEGATE", "BIND", "UPDATE"]
VERBS: Final[tuple[Verb, ...]] = get_args(Verb)

MAX_ID = 2**63 - 1
MAX_DEADLINE_MS = 86_400_000
MAX_LEASE_MS = 60_000
DEFAULT_LEASE_MS = 10_000
DEFAULT_KEEP = 64
DEFAULT_HOPS = 8
DATAGRAM = 1200  # bytes

_VERB_OF: Final[dict[str, Verb]] = {each: each for each in VERBS}
_NAME = re.compile(r"[A-Za-z0-9_.\-]{1,64}")
_PLAIN_PARAMETER = re.compile(r"[A-Za-z0-9_.~+\-]+")
_PARAMETER = re.compile(r"(?:[A-Za-z0-9_.~+\-]|%[0-9A-Fa-f]{2})+")
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")
_ADVERB = re.compile(r"([a-z_]+)=([\x21-\x7e]+)")
_NUMBER = re.compile(r"0|[1-9][0-9]*")
_EPOCH = re.compile(r"[0-9a-f]{8}")
_GRANT = re.compile(r"[0-9a-f]{16}")
_TRACE = re.compile(r"([0-9a-f]{2})-([0-9a-f]{32})-([0-9a-f]{16})-([0-9a-f]{2})(-.*)?")
_FRACTION = re.compile(r"(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][+-]?[0-9]{1,3})?")
_BODY = re.compile(r" [{\[]")


class Malformed(ValueError):
    """A line, or a part of one, that is not valid; the message says what is wrong."""


def is_name(text: str) -> bool:
    return _NAME.fullmatch(text) is not None


def default_deadline_ms(verb: Verb) -> int:
    return 30_000 if verb == "DELEGATE" else 5_000


def number_between(text: str, low: int, high: int) -> int | None:
    if len(text) > 19 or not _NUMBER.fullmatch(text):
        return None
    value = int(text)
    return value if low <= value <= high else None


def quoted(text: str) -> str:
    """Text of a peer for a message: short, on one line, and valid UTF-8."""
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text[:48])
    return f"'{shown}...'" if len(text) > 48 else f"'{shown}'"


# --- Nouns -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Noun:
    """`target:task/parameters`. The parameters are decoded; `path` is the task and they, as nodes write them."""

    target: str
    task: str
    parameters: tuple[str, ...]
    path: str


def encode_parameter(text: str) -> str:
    """A parameter of any text that is not empty, as it stands in a noun: "front left" is `front%20left`."""
    encoded = quote(text, safe="+~_.-")
    if not text or _CONTROL.search(text):
        raise Malformed("a parameter is text without control characters, and not empty")
    return encoded


def _decoded(parameter: str, number: int) -> str:
    if _PLAIN_PARAMETER.fullmatch(parameter):
        return parameter
    if _PARAMETER.fullmatch(parameter):
        try:
            text = unquote_to_bytes(parameter).decode()
        except UnicodeDecodeError:
            text = "\0"
        if not _CONTROL.search(text):
            return text
    raise Malformed(f"parameter {number} is empty" if not parameter else
                    f"parameter {number} {quoted(parameter)} contains a character or an escape that is not allowed")


def parse_noun(text: str) -> Noun:
    # Long ones are not kept: a peer may send as many of them as it likes.
    return _parse_known_noun(text) if len(text) <= 256 else _parse_noun(text)


def _parse_noun(text: str) -> Noun:
    target, colon, path = text.partition(":")
    if not colon:
        raise Malformed(f"the noun {quoted(text)} has no ':' between target and task")
    task, *parameters = path.split("/")
    for what, name in (("target", target), ("task", task)):
        if not is_name(name):
            raise Malformed(f"the {what} {quoted(name)} is not a name (1 to 64 letters, digits, '_', '-', '.')")
    if len(parameters) > 32:
        raise Malformed("more than 32 parameters")
    decoded = tuple(_decoded(each, number) for number, each in enumerate(parameters, 1))
    if "%" in path:
        path = "/".join([task, *(quote(each, safe="+~_.-") for each in decoded)])
    return Noun(target, task, decoded, path)


_parse_known_noun = lru_cache(4096)(_parse_noun)


def check_task(task: str) -> str:
    if not is_name(task) or task == "cles":
        raise Malformed(f"{quoted(task)} is not the name of a task of a program")
    return task


def check_node(name: str) -> str:
    if not is_name(name) or name in ("self", "any", "all"):
        raise Malformed(f"{quoted(name)} is not the name of a node")
    return name


# --- Traces ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Trace:
    """What a request belongs to: the trace, the sender's span, and whether spans are recorded."""

    id: str
    span: str
    recorded: bool

    def __str__(self) -> str:
        return f"00-{self.id}-{self.span}-{'01' if self.recorded else '00'}"


def parse_trace(text: str) -> Trace | None:
    found = _TRACE.fullmatch(text)
    if not found:
        return None
    version, trace, span, flags, more = found.groups()
    if version == "ff" or (version == "00" and more) or not int(trace, 16) or not int(span, 16):
        return None
    return Trace(trace, span, bool(int(flags, 16) & 1))


def is_trace_id(text: str) -> bool:
    return re.fullmatch(r"[0-9a-f]{32}", text) is not None and int(text, 16) != 0


# --- Requests --------------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Request:
    """A request line. Times are milliseconds."""

    verb: Verb
    noun: Noun
    id: int = 0  # 0: none
    deadline: int = 0  # 0: the default of the verb
    wants_reply: bool = True
    progress: bool = False
    urgent: bool = False
    every: int = 0
    keep: int = DEFAULT_KEEP
    lease: int | None = None
    seq: int = 0
    epoch: str = ""
    mark: bool = False
    hops: int = DEFAULT_HOPS
    via: tuple[str, ...] = ()
    sender: str = ""  # the adverb `from`
    sig: str = ""
    trace: Trace | None = None
    since: str = ""
    body: str = ""  # JSON; empty if there is none
    text: str = field(default="", repr=False)

    @property
    def is_update(self) -> bool:
        """Whether it is an update to a subscriber, which is never answered."""
        return self.seq != 0

    @property
    def deadline_ms(self) -> int:
        return self.deadline or default_deadline_ms(self.verb)


def _one_of(value: str, wanted: str, meaning: Any) -> Any:
    if value != wanted:
        raise Malformed
    return meaning


def _number(low: int, high: int) -> Callable[[str], int]:
    def read(value: str) -> int:
        number = number_between(value, low, high)
        if number is None:
            raise Malformed
        return number
    return read


def _lease(value: str) -> int:
    if not _NUMBER.fullmatch(value):
        raise Malformed
    return min(int(value[:9]), MAX_LEASE_MS)


def _text(pattern: str) -> Callable[[str], str]:
    compiled = re.compile(pattern)

    def read(value: str) -> str:
        if not compiled.fullmatch(value):
            raise Malformed
        return value
    return read


def _via(value: str) -> tuple[str, ...]:
    names = tuple(value.split(","))
    if not all(map(is_name, names)):
        raise Malformed
    return names


_ALL = frozenset(VERBS)
# The adverbs of this version: on which verbs, which member of a request, how to read the value.
_ADVERBS: Final[dict[str, tuple[frozenset[str], str, Callable[[str], Any]]]] = {
    "id": (_ALL, "id", _number(1, MAX_ID)),
    "deadline": (_ALL, "deadline", _number(1, MAX_DEADLINE_MS)),
    "reply": (frozenset({"PUSH", "UPDATE"}), "wants_reply", lambda v: _one_of(v, "no", False)),
    "progress": (frozenset({"DELEGATE"}), "progress", lambda v: _one_of(v, "yes", True)),
    "urgent": (frozenset({"PULL", "PUSH", "DELEGATE"}), "urgent", lambda v: _one_of(v, "yes", True)),
    "every": (frozenset({"BIND"}), "every", _number(1, MAX_DEADLINE_MS)),
    "keep": (frozenset({"BIND"}), "keep", _number(1, 65_536)),
    "lease": (frozenset({"BIND"}), "lease", _lease),
    "mark": (frozenset({"BIND"}), "mark", lambda v: _one_of(v, "yes", True)),
    "seq": (frozenset({"UPDATE"}), "seq", _number(1, MAX_ID)),
    "epoch": (frozenset({"UPDATE"}), "epoch", _text(r"[0-9a-f]{8}")),
    "hops": (_ALL, "hops", _number(0, 16)),
    "via": (_ALL, "via", _via),
    "from": (_ALL, "sender", _text(_NAME.pattern)),
    "sig": (_ALL, "sig", _text(r".{1,128}")),
    "trace": (_ALL, "trace", parse_trace),
    "since": (frozenset({"PULL"}), "since", _text(r".{1,64}")),
    "describe": (frozenset({"PULL"}), "", _text(r"[0-9a-f]{8}(,[0-9a-f]{8}){0,63}")),
    "routes": (frozenset({"PULL"}), "", _text(r"([1-9]|1[0-6])\.[A-Za-z0-9_.\-]{1,64}")),
    "grant": (frozenset({"PUSH", "DELEGATE"}), "", _text(r"(?!0{16})[0-9a-f]{16}")),
}


def split_body(line: str) -> tuple[list[str], str]:
    """The parts before the body, and the body."""
    found = _BODY.search(line)
    head, body = (line, "") if found is None else (line[:found.start()], line[found.start() + 1:])
    parts = head.split(" ")
    return ([part for part in parts if part] if "" in parts else parts), body


def _verb(word: str) -> Verb | None:
    return _VERB_OF.get(word) or (_VERB_OF.get(word.upper()) if word.isascii() else None)


def parse_request(line: str) -> Request:
    parts, body = split_body(line)
    verb = _verb(parts[0])
    if verb is None:
        raise Malformed(f"{quoted(parts[0])} is not a verb (PULL, PUSH, DELEGATE, BIND, UPDATE)")
    if len(parts) == 1:
        raise Malformed(f"{verb} without a noun (target:task)")
    request = Request(verb, parse_noun(parts[1]), body=body, text=line)
    if len(parts) > 2:
        _read_adverbs(request, parts[2:])
    if body and verb in ("PULL", "BIND"):
        raise Malformed(f"{verb} takes no body")
    if bool(request.seq) != bool(request.epoch):
        raise Malformed("an update needs both 'seq' and 'epoch', a request to publish neither")
    return request


def _read_adverbs(request: Request, parts: list[str]) -> None:
    seen = set()
    for count, part in enumerate(parts, 1):
        found = _ADVERB.fullmatch(part)
        if found is None:
            raise Malformed(f"{quoted(part)} is neither an adverb (key=value) nor a body ({{ or [)")
        if count > 16:
            raise Malformed("more than 16 adverbs")
        key, value = found.groups()
        known = _ADVERBS.get(key)
        if known is None or request.verb not in known[0]:
            if known is None and key.startswith("must_"):
                raise Malformed(f"the adverb {quoted(key)} is not known here")
            continue
        if key in seen and key != "trace":
            raise Malformed(f"the adverb {quoted(key)} occurs twice")
        try:
            read = known[2](value)
        except Malformed:
            raise Malformed(f"the adverb '{key}' has the bad value {quoted(value)}") from None
        if known[1] and not (key == "trace" and request.trace):  # the first valid trace counts
            setattr(request, known[1], read)
        seen.add(key)


@dataclass(frozen=True, slots=True)
class Salvaged:
    """What is known of a line that is not valid."""

    id: int = 0
    wants_reply: bool = True


def salvage(line: str) -> Salvaged:
    parts, _ = split_body(line)
    verb = _verb(parts[0])
    ids, wants_reply, seq, epoch = [], True, False, False
    for part in parts[1:]:
        if part.startswith("id="):
            number = number_between(part[3:], 1, MAX_ID)
            ids += [number] if number else []
        elif part == "reply=no" and verb in ("PUSH", "UPDATE"):
            wants_reply = False
        elif verb == "UPDATE" and part.startswith("seq="):
            seq = number_between(part[4:], 1, MAX_ID) is not None
        elif verb == "UPDATE" and part.startswith("epoch="):
            epoch = _EPOCH.fullmatch(part[6:]) is not None
    return Salvaged(ids[0] if len(ids) == 1 else 0, wants_reply and not (seq and epoch))


def request_line(verb: Verb, noun: str, body: str = "", *, id: int = 0, deadline: int = 0, wants_reply: bool = True,
                 progress: bool = False, urgent: bool = False, trace: Trace | None = None, lease: int | None = None,
                 every: int = 0, keep: int = 0, hops: int = DEFAULT_HOPS, mark: bool = False, sig: str = "") -> str:
    """A request as nodes write it, without LF. What has its default is left out."""
    line = f"{verb} {noun} id={id}" if id else f"{verb} {noun}"
    if deadline and deadline != default_deadline_ms(verb):
        line += f" deadline={deadline}"
    if not wants_reply:
        line += " reply=no"
    if progress:
        line += " progress=yes"
    if urgent:
        line += " urgent=yes"
    if trace:
        line += f" trace={trace}"
    if lease is not None:
        line += f" lease={lease}"
    if every:
        line += f" every={every}"
    if keep and keep != DEFAULT_KEEP:
        line += f" keep={keep}"
    if hops != DEFAULT_HOPS:
        line += f" hops={hops}"
    if mark:
        line += " mark=yes"
    if sig:
        line += f" sig={sig}"
    return f"{line} {body}" if body else line


# --- Replies ---------------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Reply:
    id: int
    body: str
    progress: float | None = None
    seq: int = 0
    epoch: str = ""


def is_reply(line: str) -> bool:
    return line.startswith(("id=", "{", "["))


def is_failure(body: str) -> bool:
    return body.startswith('{"error":"')


def parse_reply(line: str) -> Reply | None:
    """None if the reply is malformed, or without `id`."""
    if not line.startswith("id="):
        return None
    number, _, body = line.partition(" ")
    if body[:1] in ("{", "["):
        id = number_between(number[3:], 1, MAX_ID)
        return Reply(id, body) if id else None
    parts, body = split_body(line)
    id = number_between(parts[0][3:], 1, MAX_ID)
    if not id or not body:
        return None
    reply = Reply(id, body)
    for part in parts[1:]:
        found = _ADVERB.fullmatch(part)
        if found is None or found[1] == "id":
            return None
        key, value = found.groups()
        if key == "progress":
            fraction = float(value) if _FRACTION.fullmatch(value) else -1.0
            if reply.progress is not None or not 0 <= fraction <= 1:
                return None
            reply.progress = fraction
        elif key == "seq":
            reply.seq = number_between(value, 1, MAX_ID) or 0
        elif key == "epoch" and _EPOCH.fullmatch(value):
            reply.epoch = value
    if not reply.seq or not reply.epoch:
        reply.seq, reply.epoch = 0, ""
    return reply


# --- Lines -----------------------------------------------------------------------------------------------------------


def trim(line: str) -> str:
    return (line[:-1] if line.endswith("\r") else line).strip(" ")


def is_http(line: str) -> bool:
    return line.endswith((" HTTP/1.0", " HTTP/1.1")) or line[:5].lower() == "host:"


class LineBuffer:
    """Takes the bytes of a stream, returns lines. `overlong` is what has arrived of a line over the limit; then no more
    lines follow."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.overlong: str | None = None
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[str]:
        if self.overlong is not None:
            return []
        lines = data.split(b"\n")
        rest = lines.pop()
        if lines and self._rest:
            lines[0] = bytes(self._rest) + lines[0]
            self._rest = bytearray()
        out: list[str] = []
        for line in lines:
            if len(line) - line.endswith(b"\r") > self.limit:
                self._stop(line)
                return out
            out.append(line.decode("utf-8", "surrogateescape"))
        if rest:
            self._rest += rest
            if len(self._rest) - rest.endswith(b"\r") > self.limit:
                self._stop(self._rest)
        return out

    def _stop(self, line: bytes) -> None:
        self.overlong = line[:self.limit].decode("utf-8", "surrogateescape")
        self._rest = bytearray()

    def __len__(self) -> int:
        return len(self._rest)

    def unfinished(self) -> str:
        """What has arrived of a line whose end has not."""
        return self._rest.decode("utf-8", "surrogateescape")
