# SPDX-License-Identifier: BSL-1.0
"""The code blocks of a Markdown page."""

import re
from dataclasses import dataclass, field
from pathlib import Path

FENCE = re.compile(r"^(?P<mark>```+)(?P<info>.*)$")


@dataclass
class Block:
    line: int  # of its first line
    language: str
    note: str  # what follows the language, as in "sh no-test: it needs two machines"
    lines: list[str] = field(default_factory=list)

    @property
    def skipped(self) -> bool:
        return self.note.startswith("no-test")

    @property
    def host(self) -> str:
        """"1" or "2" of "console host-2 any-numbers"; empty if there is none."""
        found = re.search(r"(?:^| )host-([12])(?: |$)", self.note)
        return found[1] if found else ""

    @property
    def any_numbers(self) -> bool:
        return "any-numbers" in self.note.split()

    @property
    def by_value(self) -> bool:
        return "by-value" in self.note.split()

    @property
    def times_vary(self) -> bool:
        return "times-vary" in self.note.split()

    @property
    def in_ci(self) -> bool:
        return self.note == "ci"

    @property
    def on_two_hosts(self) -> bool:
        return "two-hosts" in self.note.split()

    @property
    def reason(self) -> str:
        return self.note.removeprefix("no-test").removeprefix(":").strip()


def blocks_of(path: Path) -> list[Block]:
    blocks: list[Block] = []
    mark = ""
    for number, line in enumerate(path.read_text(encoding="utf-8").split("\n"), 1):
        fence = FENCE.match(line)
        if mark:
            if line.strip() == mark:
                mark = ""
            else:
                blocks[-1].lines.append(line)
        elif fence:
            mark = fence["mark"]
            language, _, note = fence["info"].strip().partition(" ")
            blocks.append(Block(number + 1, language, note.strip()))
    return blocks
