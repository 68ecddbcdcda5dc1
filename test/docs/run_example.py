#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs an example and compares what it prints with the lines after `// Prints:` at the end of its source.

    run_example.py SOURCE COMMAND...
"""

import subprocess
import sys
from pathlib import Path

from transcript import difference, matches


def main(source: str, command: list[str]) -> int:
    text = Path(source).read_text(encoding="utf-8")
    head, mark, promise = text.partition("\n// Prints:\n")
    if not mark:
        print(f"{source} does not say what it prints (a comment '// Prints:' at its end)")
        return 1
    expected = [line.removeprefix("//").removeprefix(" ") for line in promise.splitlines()]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=50, check=False)
    printed = done.stdout.splitlines()
    print(done.stdout, end="")
    if done.returncode != 0:
        print(f"--- it ended with {done.returncode}")
        return 1
    if not matches(expected, printed):
        print(f"--- it prints something else than {source} says:\n{difference(expected, printed)}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
