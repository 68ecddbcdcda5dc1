# SPDX-License-Identifier: BSL-1.0
"""JSON as lines carry it: strict, without white space, of limited depth."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from typing import Any

from .errors import ConversionError

#: Nested brackets of a request, and of a reply or an update, the outermost being 1.
REQUEST_DEPTH = 32
ANSWER_DEPTH = 35

_STRING = re.compile(r'"(?:[^"\\]|\\.)*"')
_WHITE = " \t\r\n"


class Invalid(ValueError):
    """Text that is no JSON, or nested too deep."""


def _refuse(constant: str) -> None:
    raise Invalid(f"{constant} is not JSON")


_decoder = json.JSONDecoder(parse_constant=_refuse)
_scan: Callable[[str, int], tuple[Any, int]] = _decoder.scan_once  # type: ignore[attr-defined]
# Python refuses integers of more than some thousand digits, which JSON permits.
_long_decoder = json.JSONDecoder(parse_constant=_refuse, parse_int=float)
_checker = json.JSONEncoder(ensure_ascii=False)
_encoder = json.JSONEncoder(ensure_ascii=False, allow_nan=False, check_circular=False, separators=(",", ":"))


def _is_deeper(text: str, most: int) -> bool:
    if text.count("{") + text.count("[") <= most:
        return False
    depth = 0
    for c in _STRING.sub("", text):
        if c in "{[":
            depth += 1
            if depth > most:
                return True
        elif c in "}]":
            depth -= 1
    return False


def read(text: str, depth: int = REQUEST_DEPTH) -> Any:
    """The value of a JSON text. Bytes that are not UTF-8 arrive as surrogates, and are refused."""
    if _is_deeper(text, depth):
        raise Invalid(f"nested deeper than {depth} levels")
    start = len(text) - len(text.lstrip(_WHITE))
    try:
        try:
            value, end = _scan(text, start)
        except ValueError as error:
            if isinstance(error, (json.JSONDecodeError, Invalid)):
                raise
            value, end = _long_decoder.raw_decode(text, start)
        if end != len(text) and text[end:].strip(_WHITE):
            raise Invalid(f"more text after the value, at byte {end}")
        if not text.isascii():
            text.encode()
        if "\\u" in text:
            _checker.encode(value).encode()
    except StopIteration as error:
        raise Invalid(f"a value is missing at byte {error.value}") from None
    except UnicodeEncodeError:
        raise Invalid("text that is not UTF-8") from None
    except json.JSONDecodeError as error:
        raise Invalid(f"{error.msg} at byte {error.pos}") from None
    return value


def read_first(text: str, start: int) -> tuple[Any, int]:
    """The value that begins there, and where it ends. For text that was read as a whole before."""
    try:
        return _scan(text, start)
    except (StopIteration, ValueError):
        raise Invalid(f"a value is missing at byte {start}") from None


def without_nan(value: Any) -> Any:
    """A copy in which numbers that are not finite are None."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: without_nan(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [without_nan(each) for each in value]
    return value


def write(value: Any, convert: Callable[[Any], Any] | None = None) -> str:
    """The JSON text of a value, on one line. `convert` returns what stands for an object that is not JSON."""
    encoder = _encoder if convert is None else json.JSONEncoder(
        ensure_ascii=False, allow_nan=False, separators=(",", ":"), default=convert)
    try:
        text = encoder.encode(value)
    except ConversionError:
        raise
    except ValueError as error:
        if "Out of range float" not in str(error):
            raise Invalid(str(error)) from None
        text = encoder.encode(without_nan(value))
    except TypeError as error:
        raise Invalid(str(error)) from None
    except RecursionError:
        raise Invalid(f"nested deeper than {ANSWER_DEPTH} levels") from None
    if _is_deeper(text, ANSWER_DEPTH):
        raise Invalid(f"nested deeper than {ANSWER_DEPTH} levels")
    if not text.isascii():
        try:
            text.encode()
        except UnicodeEncodeError:
            raise Invalid("text that is not UTF-8") from None
    return text


def begins_with_error(value: Any) -> bool:
    """Whether this would be read as a failure."""
    return isinstance(value, dict) and bool(value) and next(iter(value)) == "error"


def enclosed(text: str) -> str:
    """A result as it stands on the line: a scalar x as {"value":x}, nothing as {}."""
    return text if text[:1] in ("{", "[") else f'{{"value":{text}}}' if text else "{}"
