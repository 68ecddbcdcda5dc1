#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Figures in prose and tables that a program prints, and prints in every run: test/docs/figures.json has what it printed, and the
pages say that.

    recorded_figures.py check ROOT                each page says what is recorded
    recorded_figures.py compare ROOT PROGRAMS     the programs still print it; those that take long are left out
    recorded_figures.py record ROOT PROGRAMS      runs all, records what they print, and changes the pages

PROGRAMS is the folder of `cles`, such as build/release/apps. For another figure, add a `Printed` to PRINTED, let its page have any
figures at that place, add what these are to figures.json, and record.
"""

import json
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

RECORD = "test/docs/figures.json"


@dataclass(frozen=True)
class Printed:
    command: str  # prints JSON
    says: Callable[[dict], Iterator[tuple[str, str]]]  # of that: a page, and a part of one of its lines
    takes_long: bool = False


def lines_of_code(out: dict) -> Iterator[tuple[str, str]]:
    ours, by_hand = out["cles_localization.cpp"], out["icd_localization.cpp"]
    yield "docs/paper.md", (f"{ours['lines']} lines ({sum(ours.values())} with `#include`), of which the traditional method takes "
                            f"{by_hand['lines'] / ours['lines']:.1f} ({sum(by_hand.values()) / sum(ours.values()):.1f}) times as many")


PRINTED = (Printed("perf/effort/count_lines.py --json", lines_of_code),)


def plain(text: str) -> str:
    """Without line breaks."""
    return " ".join(text.split())


def printed_by(each: Printed, root: Path, programs: Path) -> dict:
    program, *arguments = shlex.split(each.command)
    path = root / program if "/" in program else programs / program
    done = subprocess.run([path, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True, cwd=root)
    return json.loads(done.stdout)


def said_otherwise(each: Printed, out: dict, root: Path) -> list[str]:
    return [f"{page} does not say: {text}  ({each.command})" for page, text in each.says(out)
            if plain(text) not in plain((root / page).read_text(encoding="utf-8"))]


def check(root: Path, record: dict) -> list[str]:
    commands = {each.command for each in PRINTED}
    problems = [f"{RECORD}: '{command}' is not among PRINTED" for command in record if command not in commands]
    for each in PRINTED:
        problems += said_otherwise(each, record[each.command], root) if each.command in record \
            else [f"{RECORD}: nothing is recorded of '{each.command}'"]
    return problems


def record_all(root: Path, programs: Path, record: dict) -> list[str]:
    problems = []
    for each in PRINTED:
        out = printed_by(each, root, programs)
        before = list(each.says(record[each.command])) if each.command in record else []
        for (page, old), (_, new) in zip(before, each.says(out)):
            text = (root / page).read_text(encoding="utf-8")
            (root / page).write_text(text.replace(old, new), encoding="utf-8")
        record[each.command] = out
        problems += said_otherwise(each, out, root)
    (root / RECORD).write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return problems


def main() -> int:
    mode, root, *programs = sys.argv[1:]
    path = Path(root) / RECORD
    record = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if mode == "record":
        problems = record_all(Path(root), Path(programs[0]), record)
    elif mode == "compare":
        problems = [problem for each in PRINTED if not each.takes_long
                    for problem in said_otherwise(each, printed_by(each, Path(root), Path(programs[0]).resolve()), Path(root))]
    else:
        problems = check(Path(root), record)
    print("\n".join([*problems, f"figures that programs print: {len(PRINTED)} programs, {len(problems)} problems"]))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
