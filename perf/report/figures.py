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
    """The figures of Table 2 or a list of figures; none if the script writes only rows."""
    try:
        if "figures" in raw:
            return [_of_figure(each) for each in raw["figures"]]
        if all(isinstance(row, dict) and "elapsed_ms" in row for row in raw.get("rows") or [None]):
            return list(_of_table(raw))
    except (KeyError, TypeError, AttributeError) as failure:
        raise Malformed(f"a figure cannot be read: {failure!r}") from failure
    return []


def _of_figure(each):
    return Figure(name=str(each["name"]), what=str(each.get("what") or each["name"]), value=each["value"],
                  low=each.get("low"), high=each.get("high"), runs=each.get("runs"), unit=each.get("unit") or "",
                  paper=each.get("paper"), target=each.get("target"), reached=each.get("reached"), ran=each.get("ran") or "")


def _of_table(raw):
    """The figures of distributed stochastic gradient descent, as perf/evaluation/dsgd.py writes them."""
    checks = raw["checks"]
    for row in raw["rows"]:
        yield _summarised(row["elapsed_ms"], row["name"], row["meaning"] + ", elapsed", "ms", paper=row["paper_ms"])
    yield _summarised(checks["overhead_ms"], "overhead", "overhead: elapsed less the longest shard's own time, asked from "
                      "the same host", "ms", paper=checks["overhead_paper_ms"], target="\u2264 2",
                      reached=checks["overhead_at_most_2_ms"])
    for row in raw["rows"]:
        least, most = row["mse"]
        yield Figure(f"{row['name']}_mse", f"{row['meaning']}, mean-squared error (best possible "
                     f"{row['least_mse']:.6g})", most, least, most, row["elapsed_ms"]["runs"], "", row["paper_mse"],
                     "\u2264 0.0199", most <= 0.0199)
    yield Figure("same_mse", "the four rows of as many threads have the same error, to 6 digits",
                 "yes" if checks["same_mse_to_6_digits"] else "no", target="yes", reached=checks["same_mse_to_6_digits"])
    if "mse_found_again" in checks:
        yield Figure("mse_found_again", "each error is found again by a program that makes the data a second time, to 1e-9",
                     "yes" if checks["mse_found_again"] else "no", target="yes", reached=checks["mse_found_again"])
    yield Figure("weighted_to_even", "both hosts: elapsed with shards by speed, to even ones", checks["weighted_to_even"],
                 unit="times", ran="the same daemons on both hosts and the same data; only the division into shards differs")


def _summarised(summary, name, what, unit, **beside):
    return Figure(name, what, summary["median"], summary["low"], summary["high"], summary["runs"], unit, **beside)


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
