# SPDX-License-Identifier: BSL-1.0
"""Compares the output of a program with the output that a page shows, where `...` stands for anything."""

import difflib
import re
from decimal import Decimal

# What the clock decides, in output that is deterministic otherwise.
TIME = re.compile(r"(?P<before>\b(?:longest shard|overhead) +)?(?P<value>(?<![\w.])-?\d+(?:\.\d+)?)(?P<unit> ?(?:ns|us|\u00b5s|ms|s)\b| images per second)?")
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.]*\w)")
ONLY_A_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?: ?(?:ns|us|\u00b5s|ms|s|%))?")


def _pattern(line: str, between: str = ".*") -> re.Pattern:
    return re.compile(between.join(re.escape(part) for part in line.rstrip().split("...")))


def placeholders(expected: list[str], printed: list[str]) -> list[str]:
    """Lines of the page in which `...` stands for nothing but a number, other than a port."""
    found = []
    for line in expected:
        parts = line.rstrip().split("...")
        if len(parts) == 1 or line.strip() == "...":
            continue
        match = next(filter(None, map(_pattern(line, "(.*)").fullmatch, map(str.rstrip, printed))), None)
        if match and any(ONLY_A_NUMBER.fullmatch(shown.strip()) and not re.search(r"\d:$", before)
                         for before, shown in zip(parts, match.groups())):
            found.append(line)
    return found


def matches(expected: list[str], printed: list[str]) -> bool:
    """A line that is only `...` stands for any number of lines; elsewhere `...` stands for any text within its line."""
    if not expected:
        return not printed
    if expected[0].strip() == "...":
        return any(matches(expected[1:], printed[at:]) for at in range(len(printed) + 1))
    return bool(printed and _pattern(expected[0]).fullmatch(printed[0].rstrip()) and matches(expected[1:], printed[1:]))


def without_numbers(lines: list[str]) -> list[str]:
    """The same with every number as `0`, every time in one unit and every gap as one space, for output whose figures differ
    from run to run. A version is not such a figure: it stays."""
    return [re.sub(r"\b0 (us|ms|s)\b", "0 us", re.sub(r" +", " ", re.sub(r"(version +\d+\.\d+\.\d+)|(?:(?<![\w.])|(?<=\dT))-?\d+(\.\d+)?", lambda m: m[1] or "0", line)))
            for line in lines]


def by_value(lines: list[str], times_vary: bool) -> list[str]:
    """The same with every number in one form (1.90 is 1.9), and every gap as one space; with every time as 0 if these vary."""
    def without_time(match: re.Match) -> str:
        return f"{match['before'] or ''}0{match['unit'] or ''}" if match["before"] or match["unit"] else match[0]

    found = [re.sub(r" +", " ", TIME.sub(without_time, line) if times_vary else line) for line in lines]
    return [NUMBER.sub(lambda m: f"{Decimal(m[0]).normalize() + 0:f}", line) for line in found]


def difference(expected: list[str], printed: list[str]) -> str:
    return "\n".join(difflib.unified_diff(expected, printed, "as the page says", "as it came", lineterm=""))
