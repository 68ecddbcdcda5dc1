#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks that every ```cpp and ```cmake block of the pages occurs, line by line, in a file that is compiled or run.

    code_in_docs.py ROOT
"""

import sys
from pathlib import Path

from page import blocks_of

COMPILED = {
    "cpp": ("apps/examples/*.cpp", "apps/examples/*/*.?pp", "plugins/template/*.cpp", "test/docs/*.cpp"),
    "cmake": ("test/consumers/*/CMakeLists.txt", "plugins/template/CMakeLists.txt"),
}


def bare(lines: list[str]) -> list[str]:
    return [line.strip() for line in lines if line.strip()]


def main(root: Path) -> int:
    sources = {language: [bare(path.read_text(encoding="utf-8").splitlines())
                          for pattern in patterns for path in root.glob(pattern)]
               for language, patterns in COMPILED.items()}
    checked = 0
    missing = []
    for page in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        for block in blocks_of(page):
            if block.language not in COMPILED:
                continue
            checked += 1
            wanted = bare(block.lines)
            if not any(s[at : at + len(wanted)] == wanted for s in sources[block.language] for at in range(len(s))):
                missing.append(f"{page.relative_to(root)}:{block.line}: this code stands in no file of "
                               + ", ".join(COMPILED[block.language]))
    print("\n".join([*missing, f"code in docs: {checked} blocks checked, {len(missing)} not found"]))
    return 1 if missing or not checked else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
