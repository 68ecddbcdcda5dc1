#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Says which failed tests are worth another attempt: each one alone, because on a busy machine tests disturb each other.

    failed_tests.py RESULTS    reads what ctest wrote as JUnit XML; prints a pattern for `ctest -R`, or nothing: if more than
                               three tests failed, or one of them crashed or shows a sanitizer's report, which is never chance
    failed_tests.py --self-test
"""

import re
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

MOST = 3
CRASH = re.compile(r"Sanitizer|runtime error:|memory access violation|signal: |terminate called|Assertion [`']")


def crashed(case: ElementTree.Element) -> bool:
    failure = case.find("failure")
    ended = failure.get("message", "") if failure is not None else ""
    return ended not in ("", "Failed", "Timeout") or bool(CRASH.search(case.findtext("system-out") or ""))


def worth_another_attempt(results: Path) -> str:
    failed = [case for case in ElementTree.parse(results).iter("testcase") if case.get("status") == "fail"]
    if not 0 < len(failed) <= MOST or any(crashed(case) for case in failed):
        return ""
    return "^(" + "|".join(re.escape(case.get("name", "")) for case in failed) + ")$"


# --- The self-test -------------------------------------------------------------------------------------------------------

CASES = {
    "": "",
    '<testcase name="a.b" status="run"/>': "",
    '<testcase name="a.b" status="run"/><testcase name="c.d" status="fail"><system-out>too late</system-out></testcase>':
        r"^(c\.d)$",
    '<testcase name="a" status="fail"/><testcase name="b" status="fail"/>': "^(a|b)$",
    '<testcase name="a" status="fail"/>' * 4: "",
    '<testcase name="a" status="fail"><failure message="Failed"/></testcase>': "^(a)$",
    '<testcase name="a" status="fail"><failure message="SEGFAULT"/></testcase>': "",
    '<testcase name="a" status="fail"><system-out>WARNING: ThreadSanitizer: data race</system-out></testcase>': "",
    '<testcase name="a" status="fail"><system-out>AssertionError: 1 != 2</system-out></testcase>': "^(a)$",
    '<testcase name="a" status="fail"><system-out>clesd: x.cpp:1: f: Assertion `x\' failed.</system-out></testcase>': "",
    "<testcase name='a' status='fail'><system-out>Assertion '__n &lt; size()' failed.</system-out></testcase>": "",
    '<testcase name="a" status="fail"/>'
    '<testcase name="b" status="fail"><system-out>x.cpp:1:2: runtime error: overflow</system-out></testcase>': "",
}


def self_test() -> int:
    mistakes = []
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "tests.xml"
        for cases, expected in CASES.items():
            results.write_text(f"<testsuite>{cases}</testsuite>", encoding="utf-8")
            if (found := worth_another_attempt(results)) != expected:
                mistakes.append(f"{cases}: {found!r} instead of {expected!r}")
    print("\n".join([*mistakes, f"failed tests, self-test: {len(mistakes)} mistakes"]))
    return 1 if mistakes else 0


def main(arguments: list[str]) -> int:
    if arguments == ["--self-test"]:
        return self_test()
    if len(arguments) != 1:
        print(__doc__, file=sys.stderr)
        return 2
    print(worth_another_attempt(Path(arguments[0])))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
