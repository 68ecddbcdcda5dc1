# SPDX-License-Identifier: BSL-1.0
"""Conversion between JSON and Python types, as the C++ library converts (docs/library_reference.md, "Types")."""

from __future__ import annotations

import dataclasses
import enum
import functools
import math
import re
import types
import typing
import weakref
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timedelta, timezone
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from .errors import ConversionError

T = TypeVar("T")
SCALARS = (str, int, float, bool, type(None))


@dataclasses.dataclass(frozen=True, slots=True)
class Field:
    """What is said of a member, as in `lat: Annotated[float, Field(unit="deg", minimum=-90, maximum=90)]`.

    `name` is its name in JSON, if that is no name in Python. A number outside of its range is neither sent nor accepted.
    """

    name: str = ""
    unit: str = ""
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class Member:
    """A member of a dataclass."""

    attribute: str
    name: str
    type: Any
    field: Field
    default: Callable[[], Any] | None  # None: it is required


_members: weakref.WeakKeyDictionary[type, tuple[Member, ...]] = weakref.WeakKeyDictionary()


def members_of(cls: type) -> tuple[Member, ...]:
    """Of a dataclass."""
    known = _members.get(cls)
    if known is None:
        known = _members[cls] = _find_members(cls)
    return known


def _find_members(cls: type) -> tuple[Member, ...]:
    hints = typing.get_type_hints(cls, include_extras=True)
    out = []
    for each in dataclasses.fields(cls):
        if not each.init:
            continue
        hint, note = split_field(hints[each.name])
        default: Callable[[], Any] | None = None
        if each.default_factory is not dataclasses.MISSING:
            default = each.default_factory
        elif each.default is not dataclasses.MISSING:
            default = functools.partial(_same, each.default)
        elif is_optional(hint):
            default = functools.partial(_same, None)
        out.append(Member(each.name, note.name or each.name, hint, note, default))
    return tuple(out)


def _same(value: Any) -> Any:
    return value


def split_field(hint: Any) -> tuple[Any, Field]:
    if get_origin(hint) is Annotated:
        base, *notes = get_args(hint)
        return base, next((note for note in notes if isinstance(note, Field)), Field())
    return hint, Field()


def alternatives_of(hint: Any) -> tuple[Any, ...]:
    """Of a union; empty otherwise."""
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else ()


def is_optional(hint: Any) -> bool:
    return type(None) in alternatives_of(hint)


# --- To JSON -----------------------------------------------------------------------------------------------------------


def to_json(value: Any) -> Any:
    """What stands in JSON for an object that is not JSON itself; for `jsontext.write`."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {member.name: _checked(value, member) for member in members_of(type(value))}
    if isinstance(value, enum.Flag):
        return value.value if value.name is None or "|" in value.name else value.name
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, datetime):
        if value.tzinfo is None:
            raise ConversionError("a time without a zone: give it tzinfo, as in datetime.now(timezone.utc)")
        text = value.astimezone(timezone.utc).isoformat().replace("+00:00", "Z")
        return re.sub(r"(\.\d*?)0+Z$", r"\1Z", text)
    if isinstance(value, timedelta):
        return _duration_text(value)
    if isinstance(value, (set, frozenset)):
        return sorted(value)
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, Sequence) and not isinstance(value, (bytes, bytearray)):
        return list(value)
    raise ConversionError(f"a {type(value).__name__} has no JSON form")


def _checked(value: Any, member: Member) -> Any:
    held = getattr(value, member.attribute)
    if isinstance(held, (int, float)) and not isinstance(held, bool):
        _check_range(held, member.field, member.name)
    if isinstance(held, enum.Enum):  # also one that is a number or a text, which JSON would write as such
        return to_json(held)
    return held


def _check_range(value: float, field: Field, path: str) -> None:
    if (field.minimum is not None and value < field.minimum) or (field.maximum is not None and value > field.maximum):
        raise ConversionError(f"{path}: {value} is not from {field.minimum} to {field.maximum}")


def _duration_text(value: timedelta) -> str:
    microseconds = round(value / timedelta(microseconds=1))
    sign, microseconds = ("-" if microseconds < 0 else ""), abs(microseconds)
    seconds, fraction = divmod(microseconds, 1_000_000)
    return f"{sign}PT{seconds}{f'.{fraction:06}'.rstrip('0') if fraction else ''}S"


# --- From JSON ---------------------------------------------------------------------------------------------------------


def _name_of(value: Any) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return "a boolean"
        case int() | float():
            return "a number"
        case str():
            return "a string"
        case list():
            return "an array"
    return "an object"


def _fail(path: str, why: str) -> typing.NoReturn:
    raise ConversionError(f"{path}: {why}" if path else why)


def _expected(path: str, what: str, value: Any) -> typing.NoReturn:
    _fail(path, f"expected {what}, got {_name_of(value)}")


def is_scalar(hint: Any) -> bool:
    """Whether values of this type are sent as {"value":x}."""
    hint = split_field(hint)[0]
    if hint in SCALARS or hint is None or hint in (datetime, timedelta) or get_origin(hint) is Literal:
        return True
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return True
    others = alternatives_of(hint)
    return bool(others) and all(map(is_scalar, others))


def unwrapped(value: Any) -> Any:
    """What a result without a known type is: of {"value":x}, if x is a scalar, x."""
    if isinstance(value, dict) and len(value) == 1 and isinstance(value.get("value", value), SCALARS):
        return value["value"]
    return value


def from_json(value: Any, hint: Any, *, is_content: bool = False) -> Any:
    """The value as this type. `is_content`: of a body, a result or an update, in which a scalar is {"value":x}."""
    if is_content and is_scalar(hint) and isinstance(value, dict):
        if "value" not in value and value:
            _fail("value", "is missing")
        value = value.get("value")
    return _read(value, hint, "")


def _read(value: Any, hint: Any, path: str) -> Any:
    hint, field = split_field(hint)
    read = _read_plain(value, hint, path)
    if isinstance(read, (int, float)) and not isinstance(read, bool):
        _check_range(read, field, path)
    return read


def _read_plain(value: Any, hint: Any, path: str) -> Any:
    if hint is Any or hint is object:
        return value
    if isinstance(hint, type) and get_origin(hint) is None:
        return _read_type(value, hint, path)
    if hint is None:
        return _read_type(value, type(None), path)
    origin, arguments = get_origin(hint), get_args(hint)
    if alternatives_of(hint):
        return _read_union(value, arguments, path)
    if origin is Literal:
        if not any(value == each and type(value) is type(each) for each in arguments):
            _fail(path, f"expected one of {', '.join(map(str, arguments))}")
        return value
    if origin in (list, set, frozenset, Sequence):
        if not isinstance(value, list):
            _expected(path, "an array", value)
        items = [_read(each, arguments[0], f"{path}[{number}]") for number, each in enumerate(value)]
        return items if origin in (list, Sequence) else origin(items)
    if origin is tuple:
        return _read_tuple(value, arguments, path)
    if origin in (dict, Mapping):
        if not isinstance(value, dict):
            _expected(path, "an object", value)
        return {_read_key(key, arguments[0], path): _read(each, arguments[1], f"{path}.{key}" if path else key)
                for key, each in value.items()}
    raise TypeError(f"{hint} does not convert from JSON")


def _read_type(value: Any, hint: type, path: str) -> Any:
    if hint is float:
        if value is None:
            return math.nan  # a number that is not finite
        if not isinstance(value, (int, float)) or isinstance(value, bool):
            _expected(path, "a number", value)
        return float(value)
    if hint is int:
        if not isinstance(value, int) or isinstance(value, bool):
            _expected(path, "an integer", value) if not isinstance(value, float) else _fail(path, "expected an integer")
        return value
    if hint in (str, bool, type(None), list, dict):
        what = {str: "a string", bool: "a boolean", type(None): "null", list: "an array", dict: "an object"}[hint]
        if not isinstance(value, hint):
            _expected(path, what, value)
        return value
    if dataclasses.is_dataclass(hint):
        return _read_dataclass(value, hint, path)
    if issubclass(hint, enum.Enum):
        return _read_enum(value, hint, path)
    if hint is datetime:
        return _read_time(value, path)
    if hint is timedelta:
        return _read_duration(value, path)
    raise TypeError(f"{hint} does not convert from JSON")


def _read_dataclass(value: Any, hint: type, path: str) -> Any:
    if not isinstance(value, dict):
        _expected(path, "an object", value)
    read = {}
    for member in members_of(hint):
        where = f"{path}.{member.name}" if path else member.name
        if member.name in value:
            read[member.attribute] = _read(value[member.name], Annotated[member.type, member.field], where)
        elif member.default is not None:
            read[member.attribute] = member.default()
        else:
            _fail(where, "is missing")
    try:
        return hint(**read)
    except (TypeError, ValueError) as error:  # of its own __post_init__
        _fail(path, str(error))


def _read_enum(value: Any, hint: type[enum.Enum], path: str) -> Any:
    if issubclass(hint, enum.Flag) and isinstance(value, int) and not isinstance(value, bool):
        flags: list[enum.Enum] = list(hint.__members__.values())
        known = 0
        for each in flags:
            known |= each.value
        if value < 0 or value & ~known:
            _fail(path, f"{value} is no combination of {', '.join(hint.__members__)}")
        return hint(value)
    if not isinstance(value, str):
        _expected(path, f"one of {', '.join(hint.__members__)}", value)
    if value not in hint.__members__:
        _fail(path, f"expected one of {', '.join(hint.__members__)}")
    return hint[value]


def _read_union(value: Any, arguments: tuple[Any, ...], path: str) -> Any:
    if value is None and type(None) in arguments:
        return None
    why: ConversionError | None = None
    for each in arguments:
        try:
            return _read(value, each, path)
        except ConversionError as error:
            why = why or error
    raise why or ConversionError(path)


def _read_tuple(value: Any, arguments: tuple[Any, ...], path: str) -> Any:
    if not isinstance(value, list):
        _expected(path, "an array", value)
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return tuple(_read(each, arguments[0], f"{path}[{number}]") for number, each in enumerate(value))
    if len(value) != len(arguments):
        _fail(path, f"expected an array of {len(arguments)} elements, got {len(value)}")
    return tuple(_read(each, of, f"{path}[{number}]") for number, (each, of) in enumerate(zip(value, arguments)))


def _read_key(key: str, hint: Any, path: str) -> Any:
    if hint is int:
        if not re.fullmatch(r"-?(0|[1-9][0-9]*)", key):
            _fail(path, f"the key '{key}' is not an integer")
        return int(key)
    return _read(key, hint, path)


def _read_time(value: Any, path: str) -> datetime:
    try:
        if isinstance(value, str):
            read = datetime.fromisoformat(re.sub(r"(\.\d{6})\d+", r"\1", value))
            if read.tzinfo is None:
                raise ValueError
            return read.astimezone(timezone.utc)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return datetime.fromtimestamp(value, timezone.utc)
    except (ValueError, OverflowError, OSError):
        pass
    _fail(path, "expected a time, as in '2026-11-23T07:43:14.25Z', or seconds since 1970")


_DURATION = re.compile(r"([+-]?)P(?:(\d+)W)?(?:(\d+)D)?(?:T(?:(\d+)H)?(?:(\d+)M)?(?:(\d+(?:\.\d+)?)S)?)?")


def _read_duration(value: Any, path: str) -> timedelta:
    try:
        if isinstance(value, str) and (found := _DURATION.fullmatch(value)) and any(found.groups()[1:]):
            weeks, days, hours, minutes = (int(each or 0) for each in found.groups()[1:5])
            read = timedelta(weeks=weeks, days=days, hours=hours, minutes=minutes, seconds=float(found[6] or 0))
            return -read if found[1] == "-" else read
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return timedelta(seconds=value)
    except OverflowError:
        pass
    _fail(path, "expected a duration, as in 'PT1.5S', or a number of seconds")
