# SPDX-License-Identifier: BSL-1.0
"""Checks that the report of `scripts/evaluate` can show what the script of a section wrote."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "perf"))
from report import figures, pictures  # noqa: E402


def check(case, section, raw):
    """`case` is the unittest.TestCase that fails if not."""
    case.assertTrue(figures.figures_of(raw), f"{section}: no figure")
    for picture in pictures.pictures_of(section, raw):
        case.assertNotIn("cannot be drawn", picture.missing, picture.name)
        case.assertNotIn("it is not", picture.missing, picture.name)
