#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The manager stays as small as the paper's: less than 300 source lines of C++ (section 4.2), blank lines and comments
not counted.

    size_test.py FOLDER
"""

import sys
from pathlib import Path

LESS_THAN = 300


def source_lines(text):
    lines = (line.strip() for line in text.splitlines())
    return sum(1 for line in lines if line and not line.startswith("//"))


def main():
    assert source_lines("// no\n\nint a; // yes\n  /// no\n}\n") == 2
    counts = {path.name: source_lines(path.read_text(encoding="utf-8"))
              for path in sorted(Path(sys.argv[1]).glob("*.?pp"))}
    for name, count in counts.items():
        print(f"{count:4} {name}")
    total = sum(counts.values())
    print(f"{total:4} source lines; less than {LESS_THAN} are allowed")
    return 0 if counts and total < LESS_THAN else 1


if __name__ == "__main__":
    sys.exit(main())
