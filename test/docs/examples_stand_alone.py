#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks that each numbered example can be copied alone: it includes no other file of its folder.

    examples_stand_alone.py ROOT
"""

import re
import sys
from pathlib import Path

# It shows one file of tasks in three programs, so it needs that file.
SHARES_A_FILE = {"14_three_homes.cpp": ["three_homes/odometer.hpp"]}


def main(root: Path) -> int:
    examples = sorted((root / "apps/examples").glob("[0-9][0-9]_*.cpp"))
    wrong = []
    for example in examples:
        beside = re.findall(r'^#include "([^"]+)"', example.read_text(encoding="utf-8"), re.MULTILINE)
        if beside != SHARES_A_FILE.get(example.name, []):
            wrong.append(f"{example.relative_to(root)} includes {', '.join(beside) or 'nothing'}")
    print("\n".join([*wrong, f"examples: {len(examples)}, of which {len(wrong)} cannot be copied out alone"]))
    return 1 if wrong or not examples else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
