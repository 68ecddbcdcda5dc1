#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks that every program that a page runs is one of ours, part of every Debian system, or installed by scripts/setup.

    setup_installs.py ROOT
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from page import blocks_of
from run_doc_commands import commands_of

OURS = re.compile(r"cles(d|-\w+)?$|(scripts|perf|build|\$|/tmp)/?")
# Of the shell, coreutils, grep and sed.
BASE = {"cat", "cd", "cp", "cut", "echo", "env", "export", "grep", "head", "kill", "ls", "printf", "rm", "sed", "sleep", "source", "test",
        "timeout", "true", "unset"}
PACKAGES = {"c++": "g++", "cmake": "cmake", "ctest": "cmake", "curl": "curl", "nc": "netcat-openbsd", "pkg-config": "pkg-config",
            "python3": "python3", "ip": "iproute2"}


def programs_in(command: str) -> list[str]:
    """The first word of each part of a command line, what is substituted included; assignments passed over."""
    lexer = shlex.shlex(re.sub(r"\$\{[^}]*\}", "x", command).replace("$(", "; ").replace(")", " "), posix=True, punctuation_chars="|&;(){}<>")
    lexer.whitespace_split = True
    found, first, skip = [], True, False
    for word in lexer:
        if set(word) <= set("|&;(){}"):
            first = True
        elif set(word) <= set("<>&"):
            skip = True
        elif skip:
            skip = False
        elif first and word in ("for", "done"):
            first = False
        elif first and word != "do" and not re.match(r"\w+=", word):
            found.append(word)
            first = False
    return found


def main(root: Path) -> int:
    listed = subprocess.run([root / "scripts/setup", "--list"], env={**os.environ, "CLES_SKIP_SETUP": ""}, text=True,
                            capture_output=True, check=True).stdout.split()
    missing = []
    for page in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        for block in blocks_of(page):
            if block.language not in ("sh", "console") or block.skipped:
                continue
            for line, command, _ in commands_of(block):
                for program in programs_in(command):
                    known = OURS.match(program) or program in BASE or PACKAGES.get(program) in listed
                    if not known:
                        missing.append(f"{page.relative_to(root)}:{line}: {program}: not installed by scripts/setup")
    print("\n".join([*missing, f"programs on the pages: {len(missing)} not installed"]))
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
