# SPDX-License-Identifier: BSL-1.0
"""Checks that the report of `scripts/evaluate` can show what the script of a section wrote."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "perf"))
from report import figures, pictures  # noqa: E402


def check_ratios(case, found):
    """A ratio means nothing without what each side ran."""
    for figure in found:
        if figure.unit == "times":
            case.assertTrue(figure.ran and "\n" not in figure.ran, figure)


def check(case, section, raw):
    """`case` is the unittest.TestCase that fails if not."""
    found = figures.figures_of(raw)
    case.assertTrue(found, f"{section}: no figure")
    check_ratios(case, found)
    for picture in pictures.pictures_of(section, raw):
        case.assertNotIn("cannot be drawn", picture.missing, picture.name)
        case.assertNotIn("it is not", picture.missing, picture.name)
