#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks the model of work sharing with spin: its properties hold, each of its transitions is taken, broken variants fail.

    check_model.py             the checks in small configurations; prints a table; exits 1 if a check has another result
                               than expected
    check_model.py --full      all checks in their full configurations
    check_model.py NAME...     only the checks with these names
    check_model.py --force     also those whose results are known
    check_model.py --table     prints the transitions of sharing.pml, one a line: `holder.waiting worker_free holder.running`

Each search is exhaustive. The small configurations have fewer jobs or faults, and take half a minute of one core; every
transition is taken in them too. The full ones take minutes; two at once stay within 4 GB. Under fairness there are several
times as many states: there, one job stands for both with datagrams, and with all faults of a stream at once. A search has
the same result each time. So one that ended as expected is not repeated, in other clones neither, until the model, this
script, spin or the compiler changes: CLES_MODEL_CACHE (default ~/.cache/cles/model) contains its row of the table. The test
is skipped (77) where spin is not installed; scripts/setup installs it.
"""

import hashlib
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

MODEL = Path(__file__).with_name("sharing.pml")
TRANSITION = re.compile(r"(;?)\s*/\* T (\w+\.\w+) --(\w+)--> (\w+\.\w+) \*/")
MEMORY_MB = 2000  # of one search
SECONDS = 600     # the same: ten times what it takes
AT_ONCE = {"small": 1, "full": 2}
KNOWN = Path(os.environ.get("CLES_MODEL_CACHE") or Path.home() / ".cache/cles/model")

# Of each kind of search: how pan is compiled, and run. Without partial order reduction, which would save nothing here. Where
# spin permits it, states are stored as they are (NOCOMP): that is a quarter faster. -O3 is not, and hashes in the place of
# states (HC4) lose some.
KINDS = {
    "safety": (["-DSAFETY", "-DNOCLAIM", "-DNOCOMP"], []),   # assertions, invalid end states
    "answered": (["-DNFAIR=3"], ["-a", "-f"]),               # the LTL formula, under weak fairness
    "rest": (["-DNP", "-DNOCLAIM", "-DNFAIR=3"], ["-l", "-f"]),  # no endless execution under weak fairness
}
# What a search may find, as pan says it.
TWICE, CROWD, DEADLOCK, ENDLESS = "a job runs twice", "more jobs than workers", "deadlock", "a job is never answered"
FINDINGS = {r"assertion violated \(ran\[": TWICE, r"assertion violated \(+own==": CROWD, "invalid end state": DEADLOCK,
            "acceptance cycle": ENDLESS}


@dataclass(frozen=True)
class Check:
    name: str
    kind: str
    defines: str
    fewer: str | None = ""  # what makes it small, besides; None: it is a full check only
    refuted_by: str = ""  # what the search has to find, in a configuration that is small already; empty: nothing
    covers: bool = False  # whether every transition has to be taken
    stepwise: bool = False  # whether there have to be as many states and transitions if each step may choose
    ends_soon: bool = False  # before optimising pan would be worth it


CHECKS = [
    Check("stream", "safety", "STREAM PATIENCE", "BREAKS=0 CRASHES=0", covers=True),
    Check("stream, 2 jobs", "answered", "STREAM LIVENESS BREAKS=0", None),
    Check("stream, 1 job", "answered", "STREAM LIVENESS ONE_JOB", "BREAKS=0 CRASHES=0"),
    Check("stream, 1 job", "rest", "STREAM LIVENESS ONE_JOB", "BREAKS=0 CRASHES=0"),
    Check("stream, no faults", "rest", "STREAM LIVENESS BREAKS=0 CRASHES=0 STOPS=0", None),
    Check("datagram", "safety", "DATAGRAM BREAKS=0", "CRASHES=0", covers=True),
    Check("datagram, false loss", "safety", "DATAGRAM PATIENCE ONE_JOB", "STOPS=0 CRASHES=0"),
    Check("datagram, 1 job", "answered", "DATAGRAM LIVENESS ONE_JOB", "BREAKS=0 CRASHES=0"),
    Check("datagram, 1 job", "rest", "DATAGRAM LIVENESS BREAKS=0 ONE_JOB", "CRASHES=0 STOPS=0"),
    Check("stream, steps", "safety", "STREAM PATIENCE ONE_JOB", None, stepwise=True),
    Check("datagram, steps", "safety", "DATAGRAM PATIENCE ONE_JOB", None, stepwise=True),
    Check("RERUN_LOST", "safety", "STREAM RERUN_LOST", refuted_by=TWICE),
    Check("BUSY_WHEN_BEGUN", "safety", "STREAM BUSY_WHEN_BEGUN", refuted_by=TWICE),
    Check("FAILURE_REFUSES", "safety", "STREAM FAILURE_REFUSES", refuted_by=TWICE),
    Check("LATE_GRANT", "safety", "STREAM BREAKS=0 CRASHES=0 STOPS=0 LATE_GRANT", refuted_by=CROWD),
    Check("NO_OWN_FIRST", "safety", "STREAM BREAKS=0 CRASHES=0 STOPS=0 NO_OWN_FIRST", refuted_by=CROWD),
    Check("LOSS_UNNOTICED", "safety", "STREAM PATIENCE LOSS_UNNOTICED", refuted_by=DEADLOCK),
    Check("NO_DEDUP", "safety", "DATAGRAM BREAKS=0 NO_DEDUP", refuted_by=TWICE),
    Check("TRUST_UNKNOWN", "safety", "DATAGRAM BREAKS=0 STOPS=0 ONE_JOB TRUST_UNKNOWN", refuted_by=TWICE),
    Check("NO_DEADLINE", "answered", "STREAM LIVENESS BREAKS=0 NO_DEADLINE", refuted_by=ENDLESS),
]


def table(text: str) -> list[str]:
    """The transitions of the model, in its order, each once."""
    return list(dict.fromkeys(" ".join(match.group(2, 3, 4)) for match in TRANSITION.finditer(text)))


def instrumented(text: str) -> str:
    """The model, which also prints the number of each transition in the table when it is first taken."""
    numbers = {transition: number for number, transition in enumerate(table(text))}

    def count(match: re.Match) -> str:
        number = numbers[" ".join(match.group(2, 3, 4))]
        return f'; c_code {{ if (!taken[{number}]) {{ taken[{number}] = 1; printf("taken {number}\\n"); }} }}{match.group(1)}'

    return f"c_decl {{ static unsigned char taken[{len(numbers)}]; }}\n" + TRANSITION.sub(count, text)


def run(command: list[str], folder: Path) -> str:
    limit = ["prlimit", f"--as={2 * MEMORY_MB * 1024 * 1024}"]
    done = subprocess.run([*limit, *command], cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          check=False, timeout=SECONDS)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}\n{done.stdout}")
    return done.stdout


def found(pattern: str, text: str) -> str:
    match = re.search(pattern, text, re.MULTILINE)
    return match[1] if match else ""


def tools() -> str:
    """Their versions, and this script: what results depend on, besides the model and the check."""
    versions = [subprocess.run(command, text=True, capture_output=True, check=True).stdout
                for command in (["spin", "-V"], ["cc", "--version"])]
    return "".join([*versions, Path(__file__).read_text(encoding="utf-8")])


def check(what: Check, size: str, text: str, used: str, force: bool) -> tuple[str, str]:
    """The row of one check, and what is wrong; nothing if it is as expected. `used` is what `tools` returned."""
    if size == "small":
        what = replace(what, defines=f"{what.defines} {what.fewer}".rstrip(), ends_soon=not what.covers)
    if what.refuted_by:
        what = replace(what, ends_soon=True)
    known = KNOWN / hashlib.sha256("\0".join([repr(what), text, used]).encode()).hexdigest()
    if not force and known.is_file():
        return known.read_text(encoding="utf-8"), ""
    with tempfile.TemporaryDirectory() as folder:
        try:
            row, wrong = search(what, text, Path(folder))
        except (RuntimeError, subprocess.TimeoutExpired) as failure:
            return f"{what.name:20} {what.kind:9} failed", f"{what.name}: {failure}"
    if not wrong:
        KNOWN.mkdir(parents=True, exist_ok=True)
        being_written = known.with_suffix(f".{os.getpid()}")
        being_written.write_text(f"{row}, known since {time.strftime('%Y-%m-%d %H:%M')}", encoding="utf-8")
        being_written.replace(known)
    return row, wrong


def explore(what: Check, text: str, folder: Path, *defines: str) -> str:
    """What pan says."""
    compiled, options = KINDS[what.kind]
    (folder / "model.pml").write_text(instrumented(text) if what.covers else text, encoding="utf-8")
    run(["spin", *(f"-D{name}" for name in (*what.defines.split(), *defines)), "-a", "model.pml"], folder)
    run(["cc", "-w", "-O0" if what.ends_soon else "-O2", "-DNOREDUCE", f"-DMEMLIM={MEMORY_MB}", *compiled, "-o", "pan",
         "pan.c"], folder)
    return run(["./pan", "-n", "-m50000", "-w23", *options], folder)


def counted(said: str) -> list[str]:
    """The states of a search, and how often it came to one that it knew."""
    return [found(rf"^\s*([\d.e+]+) states, {which}", said) for which in ("stored", "matched")]


def search(what: Check, text: str, folder: Path) -> tuple[str, str]:
    said = explore(what, text, folder)
    seconds = float(found(r"^pan: elapsed time ([\d.e+-]+) seconds", said) or 0)
    errors = found(r"errors: (\d+)", said)
    states = counted(said)[0]
    memory = found(r"^\s*([\d.]+)\s+(?:total actual )?memory usage", said)
    failure = found(r"^pan:\d+: (.*)$", said)
    finding = next((name for pattern, name in FINDINGS.items() if re.match(pattern, failure)), "")

    wrong = ""
    incomplete = ("max search depth", "out of memory", *([] if what.refuted_by else ["Search not completed"]))
    if not errors or any(sign in said for sign in incomplete):
        wrong = f"the search is not complete\n{said}"
    elif what.refuted_by:
        if errors == "0" or finding != what.refuted_by:
            wrong = f"expected: {what.refuted_by}; found: {failure or 'nothing'}"
    elif errors != "0":
        wrong = failure
    elif what.stepwise and counted(said) != counted(explore(what, text, folder, "d_step=atomic", "rest_of_step=")):
        wrong = "a d_step can end in several ways: spin takes only the first"
    missing = []
    if what.covers:
        taken = {int(number) for number in re.findall(r"^taken (\d+)$", said, re.MULTILINE)}
        missing = [transition for number, transition in enumerate(table(text)) if number not in taken]
        if missing and not wrong:
            wrong = "never taken: " + ", ".join(missing)
    result = "WRONG" if wrong else f"refuted: {finding}" if what.refuted_by else "holds"
    if what.covers and not wrong:
        result += f", takes all {len(table(text))} transitions"
    row = f"{what.name:20} {what.kind:9} {float(states or 0):11,.0f} {float(memory or 0):8.0f} {seconds:8.1f}  {result}"
    return row, f"{what.name}: {wrong}" if wrong else ""


def main(arguments: list[str]) -> int:
    text = MODEL.read_text(encoding="utf-8")
    if arguments == ["--table"]:
        print("\n".join(table(text)))
        return 0
    for program in ("spin", "cc"):
        if shutil.which(program) is None:
            print(f"skipped: {program} is not installed")
            return 77
    force = "--force" in arguments
    size = "full" if "--full" in arguments else "small"
    names = [argument for argument in arguments if argument not in ("--force", "--full")]
    offered = [what for what in CHECKS if size == "full" or what.fewer is not None]
    unknown = set(names) - {what.name for what in offered}
    if unknown:
        print(f"there is no check {', '.join(sorted(unknown))} in the {size} configurations")
        return 2
    print(f"{'check':20} {'search':9} {'states':>11} {'MB':>8} {'s':>8}  result")
    wrong = []
    wanted = [what for what in offered if not names or what.name in names]
    used = tools()
    with ThreadPoolExecutor(min(AT_ONCE[size], len(os.sched_getaffinity(0)))) as at_once:
        for row, failure in at_once.map(lambda what: check(what, size, text, used, force), wanted):
            print(row, flush=True)
            wrong += [failure] if failure else []
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{usage.ru_utime + usage.ru_stime:.0f} s of CPU in all, compilation included")
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
