# SPDX-License-Identifier: BSL-1.0
"""Counts the source lines of distributed stochastic gradient descent as the paper does (section 4.2): "extending SGD into a
plugin and creating a management node to make the DELEGATE requests and combine responses". Stochastic gradient descent
itself is not counted, nor is the data."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "perf" / "effort"))
import count_lines  # noqa: E402

PLUGIN = ("plugins/sgd/order.hpp", "plugins/sgd/plugin.cpp", "plugins/sgd/tasks.cpp", "plugins/sgd/tasks.hpp")
COMBINING = ("plugins/sgd/parallel.cpp", "plugins/sgd/parallel.hpp")  # and dividing
MINIMAL = (*PLUGIN, *COMBINING, "apps/dsgd/minimal.cpp")
WITHOUT_CLES = ("apps/dsgd/local.cpp", "apps/dsgd/local.hpp")  # the threads with which it is compared
PAPER_LINES = 300  # it takes less than these


def complete():
    """The same with the manager that this evaluation runs: failures, division by speed, its options and its report."""
    manager = (path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "apps" / "dsgd").glob("*.?pp")))
    return (*PLUGIN, *COMBINING, *(each for each in manager if each not in WITHOUT_CLES and each not in MINIMAL))


def counted(files):
    """{file: {"lines", "includes"}}, by the rule of perf/effort/count_lines.py"""
    return {each: count_lines.count((ROOT / each).read_text(encoding="utf-8")) for each in files}


def total(files):
    """The lines of all, without `#include` lines and with them."""
    counts = counted(files).values()
    lines = sum(each["lines"] for each in counts)
    return lines, lines + sum(each["includes"] for each in counts)
