#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The plugin and the minimal manager together stay as small as the paper's (section 4.2), and docs/dsgd.md says how small.

    size_test.py FOLDER
"""

import sys

sys.path.insert(0, sys.argv[1])
import dsgd_lines  # noqa: E402


def main():
    minimal, complete = dsgd_lines.counted(dsgd_lines.MINIMAL), dsgd_lines.counted(dsgd_lines.complete())
    for name, count in minimal.items():
        print(f"{count:4} {name}")
    total = sum(minimal.values())
    print(f"{total:4} source lines; less than {dsgd_lines.PAPER_LINES} are allowed")
    print(f"{sum(complete.values()):4} with the manager that does more")
    page = (dsgd_lines.ROOT / "docs" / "dsgd.md").read_text(encoding="utf-8")
    missing = [words for words in (f"{total} lines", f"{sum(complete.values()):,} lines") if words not in page]
    for words in missing:
        print(f"docs/dsgd.md does not say: {words}")
    return 0 if all(minimal.values()) and total < dsgd_lines.PAPER_LINES and not missing else 1


if __name__ == "__main__":
    sys.exit(main())
