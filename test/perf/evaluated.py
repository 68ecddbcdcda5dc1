# SPDX-License-Identifier: BSL-1.0
"""Runs one section of `scripts/evaluate --quick`, for the test of its script."""

import json
import sys
from pathlib import Path
from xml.etree import ElementTree

from run_within import run_within

ROOT = Path(__file__).parents[2]


def evaluated(case, section, build, folder, limit_s, **options):
    """What its script wrote, and the words of the page about it. `case` is the unittest.TestCase that fails if it did not
    work; `folder` takes the report; the options are those of subprocess.Popen."""
    done = run_within(limit_s, [sys.executable, "-B", str(ROOT / "scripts" / "evaluate"), "--quick", "--build", str(build),
                                "-o", str(folder), "--only", section], **options)
    case.assertEqual(done.returncode, 0, done.stderr)
    told = json.loads((Path(folder) / "raw" / "run.json").read_text(encoding="utf-8"))["sections"][section]
    case.assertEqual(told["state"], "ran", told)
    raw = json.loads((Path(folder) / "raw" / f"{section}.json").read_text(encoding="utf-8"))
    page = ElementTree.parse(Path(folder) / "index.html").getroot()
    return raw, " ".join("".join(page.itertext()).split())
