#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The plugin and the minimal manager together stay as small as the paper's (section 4.2), and docs/dsgd.md says how small.

    size_test.py FOLDER
"""

import sys

sys.path.insert(0, sys.argv[1])
import dsgd_lines  # noqa: E402


def main():
    minimal = dsgd_lines.counted(dsgd_lines.MINIMAL)
    for name, count in minimal.items():
        print(f"{count['lines']:4} and {count['includes']} #include {name}")
    lines, with_includes = dsgd_lines.total(dsgd_lines.MINIMAL)
    complete, complete_with_includes = dsgd_lines.total(dsgd_lines.complete())
    print(f"{lines} source lines, {with_includes} with #include; less than {dsgd_lines.PAPER_LINES} are allowed")
    print(f"{complete} and {complete_with_includes} with the manager that does more")
    page = " ".join((dsgd_lines.ROOT / "docs" / "dsgd.md").read_text(encoding="utf-8").split())
    missing = [words for words in (f"{lines} lines, {with_includes} with", f"{complete:,} lines, {complete_with_includes:,} with")
               if words not in page]
    for words in missing:
        print(f"docs/dsgd.md does not say: {words}")
    return 0 if all(each["lines"] for each in minimal.values()) and with_includes < dsgd_lines.PAPER_LINES and not missing else 1


if __name__ == "__main__":
    sys.exit(main())
