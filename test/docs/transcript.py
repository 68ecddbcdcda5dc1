# SPDX-License-Identifier: BSL-1.0
"""Compares the output of a program with the output that a page shows, where `...` stands for anything."""

import difflib
import re


def _pattern(line: str) -> re.Pattern:
    return re.compile(".*".join(re.escape(part) for part in line.rstrip().split("...")))


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


def difference(expected: list[str], printed: list[str]) -> str:
    return "\n".join(difflib.unified_diff(expected, printed, "as the page says", "as it came", lineterm=""))
