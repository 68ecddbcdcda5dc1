#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks that the README stays short: at most 900 words, counted as `wc -w` does.

    readme_length.py ROOT
"""

import sys
from pathlib import Path

MOST = 900


def main(root: Path) -> int:
    words = len((root / "README.md").read_text(encoding="utf-8").split())
    print(f"README.md: {words} words of {MOST}")
    return 0 if words <= MOST else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
