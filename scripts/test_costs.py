#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""What the tests and the build cost, and whether a test costs more than is recorded for it.

    test_costs.py show BUILD                 prints the ten most expensive tests and targets of build/PRESET
    test_costs.py check PRESET RESULTS...    prints the tests that cost more than 1.5 times what is recorded; ends with 1 if
                                             there are any
    test_costs.py pattern PRESET RESULTS...  prints a pattern for `ctest -R` of these tests, which others may have disturbed
    test_costs.py record PRESET RESULTS...   records in test/costs/PRESET the costs of tests that are not there, and of tests
                                             that cost too much; a recorded cost rises only in a commit of its own that says
                                             why
    test_costs.py history                    checks that the commits have kept this rule
    test_costs.py --self-test

RESULTS is what ctest wrote as JUnit XML; of a test in several of them, the lowest cost counts. The cost of a test is the CPU
time of all its processes, which test/support/isolated prints. A line of test/costs/PRESET has the name of a test, its CPU
seconds, and the seconds that it took beside others; CMake schedules the tests by these (test/CMakeLists.txt). Every test may
cost as much as one of two seconds: below that, chance decides more than the test (packets that are lost, attempts at a
connection, the machine's other work).

On a machine that is slower than the one of the record, everything costs more. So the costs are divided by the median of
measured to recorded costs of all tests above two seconds, if that is between 1 and 2.
"""

import re
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
LIMIT = 1.5  # times the recorded cost
LEAST = 1.0  # CPU seconds: no test is recorded with less
LEAST_JUDGED = 2.0  # CPU seconds: every test may cost as much as one for which these are recorded
LEAST_WAIT = 5.0  # seconds: tests that take as long are recorded although they cost little, so that they start early
SLOWEST_MACHINE = 2.0
LEAST_RATIOS = 3  # of fewer tests, the median says nothing about the machine
SHOWN = 10
CPU_TIME = re.compile(r"cles: CPU time\n.*\n(\d+)m([\d.]+)s (\d+)m([\d.]+)s\s*\Z")


class Cost(NamedTuple):
    cpu: float
    wall: float


def costs_in(*results: Path) -> dict[str, Cost]:
    """The tests that have run. One that was ended at its time limit has no cost."""
    costs: dict[str, Cost] = {}
    for case in (case for result in results for case in ElementTree.parse(result).iter("testcase")):
        if found := CPU_TIME.search(case.findtext("system-out") or ""):
            user_minutes, user, system_minutes, system = map(float, found.groups())
            cost = Cost(60 * (user_minutes + system_minutes) + user + system, float(case.get("time", "0")))
            name = case.get("name", "")
            costs[name] = min(cost, costs.get(name, cost))
    return costs


def read_record(text: str) -> dict[str, Cost]:
    lines = [line.split() for line in text.splitlines() if line and not line.startswith("#")]
    return {name: Cost(float(cpu), float(wall)) for name, cpu, wall in lines}


def record_of(preset: str) -> Path:
    return ROOT / "test/costs" / preset


def recorded(preset: str) -> dict[str, Cost]:
    try:
        return read_record(record_of(preset).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}


def slowness(measured: dict[str, Cost], record: dict[str, Cost]) -> float:
    ratios = [measured[name].cpu / cost.cpu for name, cost in record.items() if name in measured and cost.cpu >= 2]
    return min(max(statistics.median(ratios), 1.0), SLOWEST_MACHINE) if len(ratios) >= LEAST_RATIOS else 1.0


def excesses(measured: dict[str, Cost], record: dict[str, Cost], slow: float) -> dict[str, float]:
    """The tests that cost too much, with what they may cost."""
    allowed = {name: LIMIT * max(record[name].cpu if name in record else 0, LEAST_JUDGED) * slow for name in measured}
    return {name: limit for name, limit in allowed.items() if measured[name].cpu > limit}


# --- The build -----------------------------------------------------------------------------------------------------------

def target_of(output: str) -> str:
    found = re.search(r"CMakeFiles/([^/]+)\.dir/", output)
    return found[1] if found else re.sub(r"^lib|\.(a|so|gch)$", "", Path(output).name)


def build_costs(log: str) -> dict[str, float]:
    """The seconds that each target took on a core, by ninja's log: it runs one command on each. Of a command that was run
    several times, the last; what the compiler cache had costs next to nothing."""
    last = {}
    for line in log.splitlines():
        fields = line.split("\t")
        if len(fields) == 5:
            begun, ended, _, output, command = fields
            last[output] = (command, int(begun), int(ended))
    commands: dict[tuple[str, int, int], str] = {}
    for output, command in last.items():
        commands.setdefault(command, target_of(output))  # a command may have several outputs
    costs: dict[str, float] = defaultdict(float)
    for (_, begun, ended), target in commands.items():
        costs[target] += (ended - begun) / 1000
    return dict(costs)


# --- The commands --------------------------------------------------------------------------------------------------------

def top(title: str, total: float, costs: dict[str, float]) -> Iterator[str]:
    yield f"{title}, {total:.0f} s in all; the most expensive:"
    for name, seconds in sorted(costs.items(), key=lambda cost: -cost[1])[:SHOWN]:
        yield f"  {seconds:7.1f} s  {name}"


def show(build: Path) -> int:
    try:
        tests = {name: cost.cpu for name, cost in costs_in(build / "tests.xml").items()}
    except (OSError, ElementTree.ParseError):
        tests = {}
    if tests:
        print("\n".join(top(f"cles: CPU time of {len(tests)} tests", sum(tests.values()), tests)))
    try:
        targets = build_costs((build / ".ninja_log").read_text(encoding="utf-8"))
    except OSError:
        targets = {}
    if targets:
        print("\n".join(top("cles: time on a core of the targets when they were last built", sum(targets.values()), targets)))
    return 0


def check(preset: str, measured: dict[str, Cost]) -> int:
    record = recorded(preset)
    slow = slowness(measured, record)
    over = excesses(measured, record, slow)
    total = sum(cost.cpu for cost in measured.values())
    print(f"{preset}: {total:.0f} CPU seconds of tests; {slow:.2f} times as slow as when the costs were recorded; "
          f"{len(over)} tests cost too much")
    for name, limit in over.items():
        before = f"{record[name].cpu:.1f} s are recorded" if name in record else "nothing is recorded"
        print(f"  {name}: {measured[name].cpu:.1f} s, {before}, and at most {limit:.1f} s allowed")
    return 1 if over else 0


def pattern(preset: str, measured: dict[str, Cost]) -> str:
    record = recorded(preset)
    over = excesses(measured, record, slowness(measured, record))
    return "^(" + "|".join(map(re.escape, over)) + ")$" if over else ""


HEADER = """\
# What the tests cost: CPU seconds, and seconds beside other tests (scripts/test_costs.py).
# A cost rises only in a commit of its own that says why.
"""


def record_text(measured: dict[str, Cost], before: dict[str, Cost]) -> str:
    """Lower costs are not recorded: a test that compiles costs less with a warm compiler cache."""
    new = {name: cost for name, cost in measured.items() if cost.cpu > LEAST or cost.wall > LEAST_WAIT}
    over = excesses(measured, before, slowness(measured, before))
    kept = {**new, **{name: cost for name, cost in before.items() if name not in over}}
    return HEADER + "".join(f"{name} {cost.cpu:.1f} {cost.wall:.1f}\n" for name, cost in sorted(kept.items()))


def write_record(preset: str, measured: dict[str, Cost]) -> int:
    if not record_of(preset).exists():
        print(f"test_costs.py: the costs of {preset} are not recorded, only those of "
              f"{', '.join(sorted(path.name for path in record_of(preset).parent.iterdir()))}", file=sys.stderr)
        return 2
    before = record_of(preset).read_text(encoding="utf-8")
    after = record_text(measured, read_record(before))
    record_of(preset).write_text(after, encoding="utf-8")
    print("\n".join(line for line in after.splitlines() if line not in before.splitlines()) or "nothing has changed")
    return 0


def risen(before: str, after: str) -> list[str]:
    """The tests that were recorded, and cost more now."""
    old, new = read_record(before), read_record(after)
    return [name for name in old if name in new and new[name].cpu > old[name].cpu]


def git(*arguments: str) -> str:
    return subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=False).stdout


def history() -> int:
    wrong = []
    # The last ones: so one mistake does not fail for ever.
    for commit in git("log", "-n", "5", "--format=%h", "--no-merges", "--", "test/costs").split():
        changed = git("show", "--format=", "--name-only", commit).split()
        files = [name for name in changed if name.startswith("test/costs/")]
        rises = [f"{name} ({file})" for file in files
                 for name in risen(git("show", f"{commit}~:{file}"), git("show", f"{commit}:{file}"))]
        if rises and (len(files) < len(changed) or not git("show", "--no-patch", "--format=%b", commit).strip()):
            wrong.append(f"{commit} raises the recorded cost of {', '.join(rises)}: that needs a commit of its own that says why")
    print("\n".join([*wrong, f"costs: {len(wrong)} commits raise some without saying why"]))
    return 1 if wrong else 0


# --- The self-test -------------------------------------------------------------------------------------------------------

CASE = '<testcase name="{}" time="{}"><system-out>OK\ncles: CPU time\n0m0.0s 0m0.0s\n0m{}s 0m{}s\n</system-out></testcase>'
RECORD = "# comment\na 4.0 5.0\nb 2.0 1.0\nc 10.0 10.0\n"
LOG = "# ninja log v5\n0\t9500\t1\tlib/CMakeFiles/cles.dir/a.cpp.o\taa\n0\t1500\t1\tlib/CMakeFiles/cles.dir/a.cpp.o\taa\n" \
      "1500\t2000\t1\tlib/libcles.a\tbb\n1500\t2000\t1\tlib/cles.map\tbb\n1500\t1600\t1\tapps/clesd\tcc\n"


def self_test() -> int:
    mistakes = []

    def expect(what: str, is_so: bool) -> None:
        if not is_so:
            mistakes.append(what)

    record = read_record(RECORD)
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "tests.xml"
        cases = [CASE.format("a", 6, "1.5", "2.0"), CASE.format("b", 1, "4.0", "0.0"), CASE.format("new", 7, "2.9", "0.2"),
                 CASE.format("small", 1, "0.1", "0.0"), '<testcase name="ended" time="60"/>']
        results.write_text(f"<testsuite>{''.join(cases)}</testsuite>", encoding="utf-8")
        measured = costs_in(results)
        alone = Path(folder) / "alone.xml"
        alone.write_text(CASE.format("b", 1, "2.0", "0.0"), encoding="utf-8")
        expect("the lowest of several costs counts", costs_in(results, alone)["b"] == Cost(2, 1))
    expect("costs are read", measured == {"a": (3.5, 6), "b": (4, 1), "new": (2.9 + 0.2, 7), "small": (0.1, 1)})
    expect("what costs too much is found", set(excesses(measured, record, 1)) == {"b", "new"})
    expect("a slow machine may take longer", set(excesses(measured, record, 1.4)) == set())
    expect("slowness is the median", slowness({"a": Cost(6, 1), "b": Cost(2, 1), "c": Cost(19, 1)}, record) == 1.5)
    expect("slowness has a limit", slowness({name: Cost(40, 1) for name in record}, record) == SLOWEST_MACHINE)
    expect("a fast machine counts as one", slowness({name: Cost(1, 1) for name in record}, record) == 1)
    expect("one test says nothing of the machine", slowness({"a": Cost(6, 1)}, record) == 1)
    expect("no record, no slowness", slowness(measured, {}) == 1)
    expect("what is recorded is read again", read_record(record_text(measured, {})) == {"a": (3.5, 6), "b": (4, 1), "new": (3.1, 7)})
    expect("what is not above its limit, or was not measured, stays",
           read_record(record_text(measured, record)) == {"a": (4, 5), "b": (4, 1), "c": (10, 10), "new": (3.1, 7)})
    expect("a rise is found", risen(RECORD, "a 4.1 1.0\nb 1.0 9.0\nd 9.0 9.0\n") == ["a"])
    expect("targets are added up", build_costs(LOG) == {"cles": 2.0, "clesd": 0.1})
    print("\n".join([*mistakes, f"test costs, self-test: {len(mistakes)} mistakes"]))
    return 1 if mistakes else 0


def main(arguments: list[str]) -> int:
    match arguments:
        case ["--self-test"]:
            return self_test()
        case ["history"]:
            return history()
        case ["show", build]:
            return show(Path(build))
        case ["check", preset, *results] if results:
            return check(preset, costs_in(*map(Path, results)))
        case ["pattern", preset, *results] if results:
            print(pattern(preset, costs_in(*map(Path, results))))
            return 0
        case ["record", preset, *results] if results:
            return write_record(preset, costs_in(*map(Path, results)))
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
