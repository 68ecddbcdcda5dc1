#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Counts the source lines of the two programs in this folder that do the same (the paper's section 4.1).

    count_lines.py [--json] [FILE...]

A source line is a line of the file, laid out as .clang-format says, that is neither empty nor all comment. `#include`
lines are counted apart, for they say what a program is made of and not what it does. Nothing else is left out: command
line, input and output, errors and data belong to each program, as they would to anybody's. This is the rule for everything
whose lines the evaluation counts; the paper does not say whether its lines contain `#include`, so both sums are shown.
"""

import argparse
import json
import re
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
PROGRAMS = ("cles_localization.cpp", "icd_localization.cpp")

# Comments, and literals that may look like comments.
TOKEN = re.compile(r"""(?P<comment>//[^\n]*|/\*.*?\*/)|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])+'""", re.DOTALL)
INCLUDE = re.compile(r"\s*#\s*include\b")


def without_comments(text):
    """The text without comments, with the same number of lines."""
    return TOKEN.sub(lambda m: "\n" * m[0].count("\n") if m["comment"] else m[0], text)


def count(text):
    lines = [line for line in without_comments(text).splitlines() if line.strip()]
    includes = sum(1 for line in lines if INCLUDE.match(line))
    return {"lines": len(lines) - includes, "includes": includes}


def main():
    parser = argparse.ArgumentParser(description="Counts source lines: neither empty nor all comment.")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("files", nargs="*", type=Path, default=[FOLDER / name for name in PROGRAMS], metavar="FILE")
    options = parser.parse_args()
    try:
        counts = {path.name: count(path.read_text(encoding="utf-8")) for path in options.files}
    except OSError as failure:
        print(f"count_lines.py: {failure.filename}: {failure.strerror}", file=sys.stderr)
        return 1
    if options.json:
        print(json.dumps(counts))
        return 0
    for name, found in counts.items():
        print(f"{found['lines']:4} lines and {found['includes']:2} includes  {name}")
    if all(name in counts for name in PROGRAMS):
        ours, by_hand = (counts[name] for name in PROGRAMS)
        print(f"by hand {by_hand['lines'] / ours['lines']:.1f} times as many, with includes "
              f"{sum(by_hand.values()) / sum(ours.values()):.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
