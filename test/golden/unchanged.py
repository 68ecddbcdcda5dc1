#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks that no recorded conversation has changed since it came, and that none is missing.

    unchanged.py [FOLDER]
    unchanged.py --self-test
"""

import hashlib
import sys
import tempfile
from pathlib import Path


def problems_of(folder: Path) -> list[str]:
    recorded = dict(reversed(line.split()) for line in (folder / "checksums").read_text(encoding="utf-8").splitlines())
    present = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(folder.glob("*.txt"))}
    problems = [f"{name} is gone" for name in recorded if name not in present]
    for name, found in present.items():
        if name not in recorded:
            problems.append(f"{name} has no line in checksums yet: '{found}  {name}'")
        elif found != recorded[name]:
            problems.append(f"{name} was changed: what version 1 says is never edited, only added to")
    if not present:
        problems.append("there are none")
    return problems


def self_test() -> list[str]:
    mistakes = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name in ("a.txt", "b.txt"):
            (folder / name).write_text(f"> {name}\n")
        sums = [f"{hashlib.sha256((folder / n).read_bytes()).hexdigest()}  {n}\n" for n in ("a.txt", "b.txt")]

        def expect(what: str, *wanted: str) -> None:
            found = problems_of(folder)
            if len(found) != len(wanted) or not all(w in f for w, f in zip(wanted, found)):
                mistakes.append(f"{what}: expected {wanted}, found {found}")

        (folder / "checksums").write_text("".join(sums))
        expect("unchanged")
        (folder / "checksums").write_text(sums[0])
        expect("a new one", "b.txt has no line")
        (folder / "checksums").write_text("".join(sums))
        (folder / "a.txt").write_text("> A.txt\n")
        expect("changed", "a.txt was changed")
        (folder / "a.txt").unlink()
        expect("removed", "a.txt is gone")
    return mistakes


def main(arguments: list[str]) -> int:
    if arguments == ["--self-test"]:
        problems = self_test()
    else:
        problems = problems_of(Path(arguments[0]) if arguments else Path(__file__).resolve().parent)
    for problem in problems:
        print(problem)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
