#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks the claims of the paper in docs/paper.md: each has a verdict, and what shows it is there: a test of this build, or a
command. Unmet are only those about other systems and encodings.

    claims_test.py ROOT BUILD
"""

import re
import subprocess
import sys
from pathlib import Path

CLAIMS = 84
LISTING, MOST_LINES = "libcles/include/cles/paper.hpp", 150  # the paper's interface is a thin header
UNMET = ("Windows", "QNX", "VxWorks", "Protobuf")
PROGRAMS = re.compile(r"build/release/apps/(cles|cles-jadc2|cles-dsgd|cles-platoon)( |$)")


def rows_of(page: str) -> list[list[str]]:
    """[number, section, claim, verdict, shown by]"""
    table = page.partition("\n## Claims\n")[2].partition("\n## ")[0]
    return [[cell.strip() for cell in line.strip().strip("|").split(" | ")]
            for line in table.splitlines() if re.match(r"\| \d+ \|", line)]


def problems_of(rows: list[list[str]], tests: set[str], root: Path) -> list[str]:
    out = []
    for at, row in enumerate(rows, 1):
        if len(row) != 5 or row[0] != str(at):
            out.append(f"row {at}: {row}")
            continue
        _, _, claim, verdict, shown = row
        kind = re.match(r"(holds|differs|unmet)\b", verdict)
        if not kind:
            out.append(f"{at}: '{verdict}' begins with no verdict")
        elif kind[0] == "unmet" and not any(word in claim for word in UNMET):
            out.append(f"{at}: '{claim}' is unmet")
        elif kind[0] != "holds" and ":" not in verdict:
            out.append(f"{at}: '{verdict}' gives no reason")
        evidence = re.findall(r"`([^`]+)`", shown)
        if not evidence and (not kind or kind[0] != "unmet"):
            out.append(f"{at}: nothing shows it")
        out += [f"{at}: there is no {each}" for each in evidence if not is_there(each, tests, root)]
    if len(rows) != CLAIMS:
        out.append(f"{len(rows)} claims, not {CLAIMS}")
    return out


def is_there(evidence: str, tests: set[str], root: Path) -> bool:
    """Of a part that is not built here, such as federation, the source of the test has to be there."""
    label, _, suite = evidence.partition(".")
    if re.fullmatch(r"\w+", label) and suite and not any(name.startswith(label + ".") for name in tests):
        return any((root / "test" / label).rglob(f"{suite.removeprefix('clesd_')}_test.*"))
    return evidence in tests or PROGRAMS.match(evidence) is not None or (root / evidence.split()[0]).is_file()


def self_test(root: Path) -> list[str]:
    good = [[str(i), "1", "a claim", "holds", "`a.test`"] for i in range(1, CLAIMS + 1)]
    wrong = {"nothing shows it": (4, "–"), "there is no a.lost": (4, "`a.lost`"), "no verdict": (3, "fine"), "is unmet": (3, "unmet: x"),
             "gives no reason": (3, "differs")}
    out = problems_of(good, {"a.test"}, root)
    for expected, (column, text) in wrong.items():
        rows = [list(row) for row in good]
        rows[6][column] = text
        found = problems_of(rows, {"a.test"}, root)
        if len(found) != 1 or expected not in found[0]:
            out.append(f"self-test: {text}: {found}")
    return out


def main(root: Path, build: str) -> int:
    listed = subprocess.run(["ctest", "--test-dir", build, "-N"], capture_output=True, text=True, check=True).stdout
    tests = set(re.findall(r"Test +#\d+: (\S+)", listed))
    rows = rows_of((root / "docs" / "paper.md").read_text(encoding="utf-8"))
    found = [*self_test(root), *problems_of(rows, tests, root)]
    if (lines := len((root / LISTING).read_text(encoding="utf-8").splitlines())) > MOST_LINES:
        found.append(f"{LISTING}: {lines} lines, {MOST_LINES} at most")
    print("\n".join([*found, f"claims of the paper: {len(rows)}, {len(found)} problems"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2]))
