# SPDX-License-Identifier: BSL-1.0
"""One form for all figures, whatever script measured them."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Figure:
    name: str
    what: str
    value: Any  # the median
    low: Any = None  # low and high are the 95 % interval of the median
    high: Any = None
    runs: Any = None
    unit: str = ""
    paper: Any = None
    target: Any = None
    reached: Any = None  # None without a target
    ran: str = ""  # of a ratio: what each side ran


class Malformed(Exception):
    """The output of a script cannot be read; the message says what is wrong."""


def figures_of(raw):
    """The list of figures; none if the script writes only rows."""
    try:
        return [_of_figure(each) for each in raw.get("figures") or []]
    except (KeyError, TypeError, AttributeError) as failure:
        raise Malformed(f"a figure cannot be read: {failure!r}") from failure


def _of_figure(each):
    return Figure(name=str(each["name"]), what=str(each.get("what") or each["name"]), value=each["value"],
                  low=each.get("low"), high=each.get("high"), runs=each.get("runs"), unit=each.get("unit") or "",
                  paper=each.get("paper"), target=each.get("target"), reached=each.get("reached"), ran=each.get("ran") or "")


# --- As text -------------------------------------------------------------------------------------------------------------

UNITS = {"us": "\u00b5s", "times": "\u00d7"}


def text_of(value):
    """A value with a suitable number of digits."""
    if value is None:
        return "\u2013"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f")
    if isinstance(value, float):
        if abs(value) >= 1000:
            return f"{value:,.0f}".replace(",", "\u202f")
        return f"{value:.6g}" if 0 < abs(value) < 0.1 else f"{value:.4g}"
    return str(value)


def with_unit(value, unit):
    if value is None or isinstance(value, (str, bool)) or not unit:
        return text_of(value)
    return f"{text_of(value)}\u00a0{UNITS.get(unit, unit)}"


def verdict(figure):
    return {True: "\u2713 reached", False: "\u2717 missed"}.get(figure.reached, "\u2013") if figure.target is not None else ""
