#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Says which tests were skipped, in whole or in part, and why. A skip that is not in the list of those allowed could have run.

    skipped_tests.py PRESET RESULTS    reads what ctest wrote as JUnit XML; ends with the number of skips that are not allowed,
                                       at most 100
    skipped_tests.py --self-test
"""

import re
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

ALLOWED = Path(__file__).with_name("allowed_skips")
PART = re.compile(r"^left out: (.+?): (.*)$", re.MULTILINE)  # test/support/python/sitecustomize.py prints it
PARTS = re.compile(r"^(?:OK|FAILED) \(.*?skipped=(\d+).*?\)$", re.MULTILINE)  # unittest prints it
CPU_TIME = re.compile(r"cles: CPU time\n.*\n.*\n?\Z")  # test/support/isolated prints it


@dataclass(frozen=True)
class Skip:
    test: str
    reason: str


def skips_in(results: Path) -> list[Skip]:
    found = []
    for case in ElementTree.parse(results).iter("testcase"):
        name, output = case.get("name", ""), CPU_TIME.sub("", case.findtext("system-out") or "")
        skipped = case.find("skipped")
        if skipped is not None or case.get("status") in ("notrun", "disabled"):
            said = re.search(r"^skipped: (.*)$", output, re.MULTILINE)
            last = output.strip().rpartition("\n")[2]
            found.append(Skip(name, said[1] if said else last or (skipped.get("message") if skipped is not None else "")))
            continue
        parts = [Skip(f"{name} {part}", reason) for part, reason in PART.findall(output)]
        count = sum(map(int, PARTS.findall(output)))
        unexplained = count - len(parts)
        found += parts + [Skip(name, f"{unexplained} without a reason")] * (unexplained > 0)
    return found


def allowed_in(text: str) -> list[tuple[str, str, str]]:
    lines = [line.split(None, 2) for line in text.splitlines() if line.strip() and not line.startswith("#")]
    return [(preset, name, reason.strip()) for preset, name, reason in lines]


def is_allowed(skip: Skip, preset: str, allowed: list[tuple[str, str, str]]) -> bool:
    return any(re.fullmatch(of, preset) and re.fullmatch(name, skip.test) and re.fullmatch(reason, skip.reason)
               for of, name, reason in allowed)


def report(preset: str, results: Path, allowed: list[tuple[str, str, str]]) -> int:
    try:
        skips = skips_in(results)
    except (OSError, ElementTree.ParseError) as failure:
        print(f"{preset}: {results} cannot be read: {failure}")
        return 1
    wrong = [skip for skip in skips if not is_allowed(skip, preset, allowed)]
    print(f"{preset}: {len(skips)} skipped, {len(wrong)} of them not allowed")
    for skip in skips:
        print(f"  {'FAILED, it could have run: ' if skip in wrong else ''}{skip.test}: {skip.reason}")
    return len(wrong)


# --- The self-test -------------------------------------------------------------------------------------------------------

CASES = """<?xml version="1.0" encoding="UTF-8"?>
<testsuite name="(empty)" tests="7" failures="0" disabled="1" skipped="3">
<testcase name="unit.line" status="run"><system-out>fine\nOK</system-out></testcase>
<testcase name="perf.allocations" status="notrun"><skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/>
<system-out>skipped: a sanitizer counts too
</system-out></testcase>
<testcase name="docs.two" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/><system-out>no hosts
cles: CPU time
0m0.00s 0m0.00s
0m0.01s 0m0.02s
</system-out></testcase>
<testcase name="cli.none" status="notrun"><skipped message="Unable to find executable"/><system-out/></testcase>
<testcase name="cli.off" status="disabled"><system-out>Disabled</system-out></testcase>
<testcase name="cli.shells" status="run"><system-out>.s
left out: __main__.Shells.test_zsh: zsh is not installed
OK (skipped=1)</system-out></testcase>
<testcase name="cli.silent" status="run"><system-out>.ss
OK (skipped=2, expected failures=1)</system-out></testcase>
</testsuite>
"""
EXPECTED = [Skip("perf.allocations", "a sanitizer counts too"), Skip("docs.two", "no hosts"),
            Skip("cli.none", "Unable to find executable"), Skip("cli.off", "Disabled"),
            Skip("cli.shells __main__.Shells.test_zsh", "zsh is not installed"), Skip("cli.silent", "2 without a reason")]


def self_test() -> int:
    mistakes = []
    allowed = allowed_in("# why\n\nasan|tsan  perf\\.\\w+  a sanitizer .*\n.*  cli\\.off  Disabled\n")
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "tests.xml"
        results.write_text(CASES, encoding="utf-8")
        if skips_in(results) != EXPECTED:
            mistakes.append(f"found {skips_in(results)}")
        for preset, wrong in (("asan", 4), ("release", 5)):
            if report(preset, results, allowed) != wrong:
                mistakes.append(f"of {preset} {wrong} are not allowed")
        results.write_text("<testsuite>", encoding="utf-8")
        if report("asan", results, allowed) != 1 or report("asan", Path(folder) / "none.xml", allowed) != 1:
            mistakes.append("what cannot be read goes unseen")
    if not allowed_in(ALLOWED.read_text(encoding="utf-8")):
        mistakes.append("the list of those allowed is empty")
    print("\n".join([*mistakes, f"skipped tests, self-test: {len(mistakes)} mistakes"]))
    return 1 if mistakes else 0


def main(arguments: list[str]) -> int:
    if arguments == ["--self-test"]:
        return self_test()
    if len(arguments) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    return min(report(arguments[0], Path(arguments[1]), allowed_in(ALLOWED.read_text(encoding="utf-8"))), 100)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
