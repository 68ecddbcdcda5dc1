#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks that measured figures on the pages are those of perf/README.md, so that none contradicts another.

    figures_agree.py ROOT

It checks decimals in lines with microseconds, a p50 or a p99, and all those of the README's comparison. docs/evaluation.md is made
from its own record, with which perf.evaluation_page compares it.
"""

import re
import sys
from pathlib import Path

DECIMAL = re.compile(r"(?<![\w.])\d+\.\d+(?![\w.]*\d)")
MEASURED = re.compile(r"\d µs|\bp(50|99|99\.9)\b")
FROM_A_RECORD = "evaluation.md"
VERSIONS = re.compile(r"Linux \d+\.\d+|g\+\+ \d+\.\d+|Boost \d+\.\d+|section \d+\.\d+|Listing \d+\.\d+|p99\.9")


def figures_of(page: Path) -> list[tuple[int, str]]:
    found, compared, fenced = [], False, False
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        fenced ^= line.startswith("```")
        if line.startswith("## "):
            compared = page.name == "README.md" and "Measured" in line
        if not fenced and (compared or MEASURED.search(line)):
            found += [(number, figure) for figure in DECIMAL.findall(VERSIONS.sub("", line))]
    return found


def main(root: Path) -> int:
    measured = set(DECIMAL.findall((root / "perf/README.md").read_text(encoding="utf-8")))
    checked, wrong = 0, []
    for page in [root / "README.md", *sorted(each for each in (root / "docs").glob("*.md") if each.name != FROM_A_RECORD)]:
        for line, figure in figures_of(page):
            checked += 1
            if figure not in measured:
                wrong.append(f"{page.relative_to(root)}:{line}: {figure} is no figure of perf/README.md")
    print("\n".join([*wrong, f"figures on the pages: {checked} checked, {len(wrong)} of them not in perf/README.md"]))
    return 1 if wrong or not checked else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
