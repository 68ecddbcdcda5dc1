#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the commands that a page shows, in their order, in one shell.

    run_doc_commands.py --root ROOT --build BUILD --path FOLDER PAGE...
    run_doc_commands.py --self-test

- In a ```console block, what follows `$ ` is a command (a `\\` at its end goes on in the next line), and what follows the
  command is what it prints, where `...` stands for anything (alone on a line: for any lines).
- In a ```sh block every line is a command, and has to succeed.
- In "console any-numbers" blocks the numbers in what is printed, and the width of gaps, are those of one run. Commands whose output
  is the same in every run must not be there.
- In "console by-value" blocks numbers are compared by value, and gaps by being there; with "times-vary" too, times are those of one
  run.
- `...` does not stand for a number alone: the page shows that of one run.
- A command that ends in ` &` goes on in the background; the next one waits until it has printed what the page says, or
  anything; its log, on stderr, is left out. It is stopped at the end of its page.
- Nodes find each other in a group of the page's own.
- "sh no-test: REASON" and "console no-test: REASON" are left out, but not in README.md.
- "sh ci" blocks are too large for a test: each of their commands has to be one that .ci/run runs.
- "two-hosts" blocks run a second time, after the page, on two hosts as below: on the first host up to the last command that
  goes on in the background, on the second one what follows it.
- "console host-1" and "console host-2" blocks run on two hosts with a cable between them (network namespaces), each in a
  shell of its own, which has eth0 with 192.168.1.11 and 192.168.1.12. There ports and the group are those of the page.
  Where no namespaces can be made it ends with 77; with CI=true that is a failure.

The commands run from ROOT, with FOLDER (where `cles` is) in the path. So that runs do not meet, /tmp stands for a fresh
folder, and build/release for BUILD. On a host that has only loopback, as the network namespace of a test has, nothing else
differs from what the page says. Elsewhere ports 253xx (the default 25370 too, and the multicast group's) stand for free ones;
a program that listens at the default port without being told so then fails if the port is taken.
"""

import argparse
import os
import re
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from dataclasses import dataclass
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parent.parent / "cli"))
from page import Block, blocks_of  # noqa: E402
from transcript import by_value, difference, matches, placeholders, without_numbers  # noqa: E402
from two_hosts import Hosts  # noqa: E402

MARK = "--end-of-command--"
DETERMINISTIC = re.compile(r"\bcles-platoon simulate\b|\bcles-jadc2 (rehearse|compare)\b|\bcles-dsgd --local\b"
                           r"|\bcles delegate \S+:primes\b")
PATIENCE = 30.0


class Mistake(Exception):
    pass


class Substitution:
    """Translates between the page and what is run."""

    def __init__(self, build: Path, scratch: Path, own_ports: bool = False):
        self.build = str(build)
        self.scratch = str(scratch)
        self.own_ports = own_ports  # the host is used only by this page, so its ports are free
        self.ports: dict[str, str] = {}

    def to_run(self, command: str) -> str:
        command = re.sub(r"\b253\d\d\b", lambda m: self.port_for(m[0]), command)
        return re.sub(r"(?<![\w.])/tmp\b", self.scratch, command).replace("build/release", self.build)

    def as_on_page(self, text: str) -> str:
        for shown, used in self.ports.items():
            text = re.sub(rf"\b{used}\b", shown, text)
        return text.replace(self.scratch, "/tmp").replace(self.build, "build/release")

    def port_for(self, shown: str) -> str:
        if self.own_ports:
            return shown
        if shown not in self.ports:
            with socket.socket() as probe:
                probe.bind(("127.0.0.1", 0))
                self.ports[shown] = str(probe.getsockname()[1])
        return self.ports[shown]


class Shell:
    def __init__(self, root: Path, environment: dict[str, str], scratch: Path, inside: tuple[str, ...] = ()):
        self.scratch = scratch
        self.scratch.mkdir(exist_ok=True)
        self.background: list[int] = []
        self.process = subprocess.Popen(
            [*inside, "bash", "--noprofile", "--norc"], cwd=root, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT)

    def run(self, command: str) -> tuple[int, str]:
        """Its exit status and output."""
        self._send(f"{{ {command}\n}} </dev/null\n")
        return self._finish(command)

    def start(self, command: str, expected: list[str], substitution: Substitution) -> None:
        log = self.scratch / f"background-{len(self.background)}.log"
        self._send(f"{command} </dev/null >'{log}' 2>'{log}.err' &\necho $!\n")
        self.background.append(int(self._finish(command)[1]))
        until = time.monotonic() + PATIENCE
        while True:
            printed = substitution.as_on_page(log.read_text() if log.exists() else "").splitlines()
            if matches(expected, printed) if expected else printed:
                return
            if time.monotonic() > until:
                said = Path(f"{log}.err").read_text()
                raise Mistake(f"in the background it printed\n{difference(expected, printed)}\n{said}")
            time.sleep(0.01)

    def close(self) -> None:
        for pid in self.background:
            try:
                os.kill(pid, signal.SIGTERM)
            except ProcessLookupError:
                pass
        self.process.stdin.close()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()

    def _send(self, text: str) -> None:
        self.process.stdin.write(text.encode())

    def _finish(self, command: str) -> tuple[int, str]:
        self._send(f"printf '%s%d\\n' '{MARK}' $?\n")
        self.process.stdin.flush()
        out = b""
        until = time.monotonic() + PATIENCE
        while not (found := re.search(rf"{MARK}(\d+)\n$", out.decode(errors="replace"))):
            ready, _, _ = select.select([self.process.stdout], [], [], max(0.0, until - time.monotonic()))
            chunk = os.read(self.process.stdout.fileno(), 65536) if ready else b""
            if not chunk:
                raise Mistake(f"'{command}' did not end within {PATIENCE:.0f} s; so far it printed\n{out.decode(errors='replace')}")
            out += chunk
        text = out.decode(errors="replace")
        return int(found[1]), text[: found.start()]


def commands_of(block: Block) -> list[tuple[int, str, list[str]]]:
    """(line, command, output); the output is empty for a block without outputs."""
    result: list[tuple[int, str, list[str]]] = []
    goes_on = False
    for number, line in enumerate(block.lines, block.line):
        is_command = goes_on or block.language == "sh" or line.startswith("$ ")
        text = line.removeprefix("$ ") if block.language == "console" and not goes_on else line
        if goes_on:
            at, command, printed = result[-1]
            result[-1] = (at, command[:-1].rstrip() + " " + text.strip(), printed)
        elif is_command:
            command = re.sub(r"\s+#\s.*$", "", text).strip()
            if not command or command.startswith("#"):
                continue
            result.append((number, command, []))
        elif result:
            result[-1][2].append(line)
        elif line.strip():
            raise Mistake(f"line {number}: in a console block a command begins with '$ '")
        goes_on = is_command and line.rstrip().endswith("\\")
    return result


def agree(block: Block, expected: list[str], printed: list[str]) -> bool:
    if block.by_value:
        return matches(by_value(expected, block.times_vary), by_value(printed, block.times_vary))
    if block.any_numbers:
        return matches(without_numbers(expected), without_numbers(printed))
    return matches(expected, printed)


def free_udp_port() -> int:
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def has_only_loopback() -> bool:
    return [name for _, name in socket.if_nameindex()] == ["lo"]


@dataclass
class Step:
    """A command of a page, and on which of its hosts it runs."""
    block: Block
    line: int
    command: str
    expected: list[str]
    host: str


def steps_of(blocks: list[Block]) -> list[Step]:
    return [Step(block, *command, block.host) for block in blocks for command in commands_of(block)]


def steps_on_two_hosts(blocks: list[Block]) -> list[Step]:
    steps = []
    for block in blocks:
        commands = commands_of(block)
        last = max((at for at, (_, command, _) in enumerate(commands) if command.endswith(" &")), default=-1)
        steps += [Step(block, *command, "1" if at <= last else "2") for at, command in enumerate(commands)]
    return steps


def check_left_out(page: Path, root: Path, block: Block) -> list[str]:
    where = f"{page}:{block.line}"
    if block.in_ci:
        ci = (root / ".ci" / "run").read_text(encoding="utf-8")
        return [f"{where}: .ci/run does not run '{command}'" for _, command, _ in commands_of(block)
                if not re.search(rf"(?<!\S){re.escape(command)}(?!\S)", ci)]
    if page.name == "README.md":
        return [f"{where}: every command of the README has to be tested"]
    if not block.reason:
        return [f"{where}: 'no-test' needs a reason, as in 'no-test: two machines'"]
    return []


def run_page(page: Path, root: Path, build: Path, path: Path) -> list[str]:
    blocks = [block for block in blocks_of(page) if block.language in ("sh", "console")]
    tested = [block for block in blocks if not block.skipped and not block.in_ci]
    problems = [problem for block in blocks if block not in tested for problem in check_left_out(page, root, block)]
    problems += [f"{page}:{line}: 'any-numbers', but the output of '{command}' is the same in every run: 'by-value'"
                 for block in tested if block.any_numbers
                 for line, command, _ in commands_of(block) if DETERMINISTIC.search(command)]
    hosts = any(block.host for block in tested)
    for block in tested:
        if bool(block.host) != hosts:
            problems.append(f"{page}:{block.line}: on which host? 'host-1' or 'host-2' stands behind the language")
    try:
        problems += run_steps(page, steps_of([block for block in tested if bool(block.host) == hosts]), root, build, path)
        apart = steps_on_two_hosts([block for block in tested if block.on_two_hosts])
        if apart:
            problems += run_steps(page, apart, root, build, path)
    except Mistake as mistake:
        problems.append(f"{page}: {mistake}")
    return problems


def run_steps(page: Path, steps: list[Step], root: Path, build: Path, path: Path) -> list[str]:
    problems: list[str] = []
    hosts = Hosts(("eth0", "192.168.1.11/24"), ("eth0", "192.168.1.12/24")) if any(s.host for s in steps) else None
    scratch = Path(tempfile.mkdtemp(prefix="cles-docs-"))
    own_ports = hosts is not None or has_only_loopback()
    substitution = Substitution(build, scratch, own_ports)
    programs = scratch / "bin"
    programs.mkdir()
    if not shutil.which("nc"):
        (programs / "nc").symlink_to(Path(__file__).resolve().parent / "netcat.py")
    inherited = {name: value for name, value in os.environ.items() if name != "CLES_AT"}
    environment = {**inherited, "LC_ALL": "C.UTF-8", "NO_COLOR": "1", "COLUMNS": "120", "CLES_CONTEXT": "",
                   "CLES_MULTICAST": f"lo,239.255.25.37:{free_udp_port()}",
                   "PATH": os.pathsep.join([str(path), str(programs), os.environ["PATH"]])}
    if own_ports:
        del environment["CLES_MULTICAST"]
    if hosts:
        shells = {"1": Shell(root, environment, scratch / "host-1", tuple(hosts.inside(hosts.near))),
                  "2": Shell(root, environment, scratch / "host-2", tuple(hosts.inside(hosts.far)))}
    else:
        shells = {"": Shell(root, environment, scratch)}
    try:
        for step in steps:
            shell = shells[step.host]
            where = f"{page}:{step.line}: $ {step.command}" + (f" (on host {step.host})" if step.host else "")
            to_run = substitution.to_run(step.command)
            if to_run.endswith(" &"):
                shell.start(to_run.removesuffix(" &"), step.expected, substitution)
                print(f"ok   {where}")
                continue
            status, output = shell.run(to_run)
            printed = substitution.as_on_page(output).splitlines()
            if step.block.language == "sh" and status != 0:
                problems.append(f"{where}\nended with {status}:\n" + "\n".join(printed))
            elif step.block.language == "console" and not agree(step.block, step.expected, printed):
                problems.append(f"{where}\n{difference(step.expected, printed)}")
            elif shown := placeholders(step.expected, printed):
                problems.append(f"{where}\n'...' stands for a number: show that of one run\n" + "\n".join(shown))
            else:
                print(f"ok   {where}")
    except Mistake as mistake:
        problems.append(f"{page}: {mistake}")
    finally:
        for shell in shells.values():
            shell.close()
        if hosts:
            hosts.close()
        shutil.rmtree(scratch, ignore_errors=True)
    print(f"{page.name}: {len(steps)} commands, {len(problems)} problems")
    return problems


GOOD = """\
```console
$ echo one; echo two 253; false
one
...
$ (echo up; exec sleep 20) &
up
$ printf '%s\\n' a \\
    b
a
b
$ echo 25370 /tmp/x
25370 /tmp/x
$ cat
```
```console any-numbers
$ echo '1  -2.5 {"a":3.25} x4'
10 3 {"a":7} x4
```
```console by-value
$ echo '1.50  -2.5 {"a":0.10} x4 took 7 ms'
1.5 -2.50 {"a":0.1} x4 took 7.0 ms
```
```console by-value times-vary
$ echo 'error 1.50, 1.25 ms of 3 s, overhead 0.5'
error 1.5, 4 ms of 20 s, overhead 7
```
```sh
true # why
test -d /tmp
```
```sh no-test: it would fail
false
```
"""
BAD = [("```console\n$ echo one\ntwo\n```\n", "+one"), ("```console any-numbers\n$ echo 1 b\n1 c\n```\n", "+1 b"),
       ("```console any-numbers\n$ echo version 1.0.0\nversion 0.1.0\n```\n", "+version 1.0.0"),
       ("```console by-value\n$ echo ratio 1.51\nratio 1.5\n```\n", "+ratio 1.51"),
       ("```console by-value\n$ echo 1.5 ms\n1.6 ms\n```\n", "+1.5 ms"),
       ("```console by-value times-vary\n$ echo 1.5 m\n1.6 m\n```\n", "+1.5 m"),
       ("```console any-numbers\n$ echo took 1.5 ms\ntook ...\n```\n", "'...' stands for a number"),
       ("```console\n$ true cles-jadc2 compare | cat\n```\n```console any-numbers\n$ true cles-platoon simulate\n```\n", "the same in every run"),
       ("```sh\nfalse\n```\n", "ended with 1"),
       ("```sh no-test\ntrue\n```\n", "needs a reason"), ("```sh ci\nscripts/test\nscripts/other\n```\n", "not run 'scripts/other'"),
       ("```sh two-hosts\n(echo up; exec sleep 20) &\n! grep -q 192.168.1.12 /proc/net/fib_trie\n```\n", "(on host 2)"),
       ("```sh host-1\ntrue\n```\n```sh\ntrue\n```\n", "on which host"), ("```console\necho\n```\n", "begins with '$ '")]


def self_test() -> int:
    failures = []
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.md"
        (Path(folder) / ".ci").mkdir()
        (Path(folder) / ".ci" / "run").write_text("tested test release scripts/test\n", encoding="utf-8")

        def problems(text: str) -> list[str]:
            page.write_text(text, encoding="utf-8")
            return run_page(page, Path(folder), Path(folder), Path(folder))

        failures += problems(GOOD)
        for text, expected in BAD:
            try:
                found = problems(text)
            except unittest.SkipTest as reason:
                print(f"left out: {reason}")
                continue
            if len(found) != 1 or expected not in found[0]:
                failures.append(f"{text!r}: expected '{expected}', found {found}")
    print("\n".join([*failures, f"self-test: {len(failures)} mistakes"]))
    return 1 if failures else 0


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--self-test", action="store_true")
    parser.add_argument("--root", type=Path)
    parser.add_argument("--build", type=Path)
    parser.add_argument("--path", type=Path)
    parser.add_argument("pages", type=Path, nargs="*")
    options = parser.parse_args()
    if options.self_test:
        return self_test()
    try:
        problems = [problem for page in options.pages
                    for problem in run_page(page, options.root, options.build, options.path)]
    except unittest.SkipTest as reason:
        print(f"skipped: {reason}")
        return 77
    print("\n\n".join(problems))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
