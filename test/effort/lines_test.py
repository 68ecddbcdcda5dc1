#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The exchange by CLES takes at most as many lines as the paper's (section 4.1), and the counting is correct.

    lines_test.py FOLDER
"""

import json
import subprocess
import sys
import unittest
from pathlib import Path

FOLDER = Path(sys.argv[1])
sys.path.insert(0, str(FOLDER))
import count_lines  # noqa: E402

PAPER_LINES = 30


class Lines(unittest.TestCase):
    def test_cles_takes_at_most_as_many_as_the_paper(self):
        done = subprocess.run([sys.executable, "-B", str(FOLDER / "count_lines.py"), "--json"], capture_output=True,
                              text=True, check=True)
        counts = json.loads(done.stdout)
        ours, by_hand = counts["cles_localization.cpp"]["lines"], counts["icd_localization.cpp"]["lines"]
        print(f"CLES {ours}, by hand {by_hand}: {by_hand / ours:.1f}")
        self.assertGreater(ours, 0)
        self.assertLessEqual(ours, PAPER_LINES)

    def test_only_empty_lines_and_comments_are_left_out(self):
        text = ('// no\n#include <a> // apart\n\n  /* no\n no */\nint a; // yes\nconst char* b = "// yes"; /* no */\n'
                "char c = '\"'; // yes\n/* no */ int d;\n#define E\n}\n")
        self.assertEqual(count_lines.count(text), {"lines": 6, "includes": 1})

    def test_a_file_that_is_not_there_is_told(self):
        done = subprocess.run([sys.executable, "-B", str(FOLDER / "count_lines.py"), "/nowhere/a.cpp"],
                              capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertIn("/nowhere/a.cpp", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
