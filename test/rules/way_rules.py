#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks the code paths that CONTRIBUTING.md lists, and the file names in it, against the tree.

    way_rules.py [ROOT]        checks the page; prints each violation; exits 1 where there is one
    way_rules.py --self-test   plants violations in a scratch tree and expects to find every one of them

A way is a block of code whose language is `way`: a title, then one step per line with a mark, a file, a type, and what
it decides.

    PULL, served: there and back; 2 files, 2 types
         libcles/src/node/a.cpp   a           the step before includes the header of this one
    ask  libcles/src/node/b.cpp   b           asked by the step before, which goes on with the answer
    via  libcles/src/node/c.hpp   c           how the next step is reached: an interface, a base or a shared struct
    back libcles/src/node/a.cpp   a           from here on the way leads back

The title says `one way` (no file twice), `there and back` (no file twice in either direction) or, where that does not
hold, `comes back to` with the names of the files (without suffix); `each boundary once` where library, daemon and plugin are entered and
left once; and how many files and types there are, without those of `via`. A type with `()` is a function, which does
not count.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

sys.dont_write_bytecode = True  # the next line would leave it among the sources
from include_rules import includes_of, without_comments_and_strings, write_tree  # noqa: E402

PAGE = "CONTRIBUTING.md"
# The paths that the page must list, and the maximum number of files and types where there is one.
WANTED = {
    "PULL, served": 12,
    "PULL, asked": None,
    "UPDATE, published": None,
    "UPDATE, received": None,
    "DELEGATE in clesd": None,
}
# Where included headers are, and what the page may leave out in front of a path.
BASES = ["libcles/include", "libcles/src", "runtime/src", "test"]
PUBLIC = "libcles/include/"
# What runs where, by the longest prefix: the plugin's half of the C interface is compiled into plugins.
LANDS = {"libcles/": "library", "libcles/include/cles/plugin": "plugin", "runtime/": "daemon", "plugins/": "plugin"}

FENCE = re.compile(r"^ {0,3}(```+)\s*(\S*)")
TITLE = re.compile(r"(?P<name>[^:;]+): (?P<clauses>.+)$")
FIGURES = re.compile(r"(\d+) files, (\d+) types$")
STEP = re.compile(r"(?P<mark>ask|via|back|) +(?P<file>\w[\w.]*/[\w./-]+) +(?P<type>\w+(?:\(\))?)(?: +(?P<words>\S.*))?$")
PATH = re.compile(r"(?:[\w.-]+/)+[\w.*{},-]*$")


class Step:
    def __init__(self, line: int, mark: str, file: str, type_name: str, words: str):
        self.line, self.mark, self.file, self.type, self.words = line, mark, file, type_name, words


class Way:
    def __init__(self, line: int, title: str):
        self.line, self.title = line, title
        self.name, self.clauses = title, []
        self.steps: list[Step] = []
        self.readable = True


class Page:
    def __init__(self, root: Path):
        self.root = root
        self.violations: list[str] = []
        self.texts: dict[str, str] = {}
        self.direct: dict[str, set[str]] = {}
        self.ways: list[Way] = []
        self.paths = 0

    def complain(self, line: int, what: str) -> None:
        self.violations.append(f"{PAGE}:{line}: {what}")

    # -- the sources -----------------------------------------------------------------------------------------------

    def text(self, name: str) -> str:
        """A source without comments; empty where there is none."""
        if name not in self.texts:
            path = self.root / name
            raw = path.read_text(encoding="utf-8") if path.is_file() else ""
            self.texts[name] = without_comments_and_strings(raw)
            self.direct[name] = {found for _, quote, header in includes_of(raw)
                                 if (found := self.resolve(name, quote, header))}
        return self.texts[name]

    def resolve(self, name: str, quote: str, header: str) -> str:
        """The file of this tree that an include means; empty where it is another project's."""
        folders = ([str(Path(name).parent)] if quote == '"' else []) + BASES
        return next((f"{f}/{header}" for f in folders if (self.root / f / header).is_file()), "")

    def includes(self, name: str) -> set[str]:
        self.text(name)
        return self.direct[name]

    @staticmethod
    def header_of(name: str) -> str:
        return re.sub(r"\.cpp$", ".hpp", name)

    def files_of(self, name: str) -> list[str]:
        """A source and its header, which may be a public one."""
        stem = name.rpartition(".")[0]
        pair = {f for f in (f"{stem}.hpp", f"{stem}.cpp") if (self.root / f).is_file()}
        public = f"{PUBLIC}cles/{Path(stem).name}.hpp"
        return sorted({name, *pair} | ({public} if pair == {f"{stem}.cpp"} and (self.root / public).is_file() else set()))

    def all_includes(self, name: str) -> set[str]:
        """What a source and its header include, directly or through others."""
        found: set[str] = set()
        waiting = self.files_of(name)
        while waiting:
            new = self.includes(waiting.pop()) - found
            found |= new
            waiting += new
        return found

    def reach(self, name: str, named: set[str]) -> set[str]:
        """The headers that a step reaches: those that it includes, and those that the files `named` by the way add to them.

        Among public headers, each counts as included where another includes it.
        """
        found = set(self.files_of(name)).union(*(self.includes(f) for f in self.files_of(name)))
        found = found.union(*(self.includes(f) for f in found & named))
        waiting = [f for f in found if f.startswith(PUBLIC)]
        while waiting:
            new = {f for f in self.includes(waiting.pop()) if f.startswith(PUBLIC)} - found
            found |= new
            waiting += new
        return found

    def names(self, file: str, type_name: str) -> bool:
        word = re.compile(rf"\b{type_name.removesuffix('()')}(_ptr)?\b")
        return any(word.search(self.text(f)) for f in self.files_of(file))

    def declares(self, file: str, type_name: str) -> bool:
        name = type_name.removesuffix("()")
        if type_name != name:
            pattern = re.compile(rf"\b{name}\s*\(")
        else:
            pattern = re.compile(rf"\b(?:class|struct|enum class)\s+{name}\b(?!\s*;)[^;(){{}}]*\{{|\busing\s+{name}\s*="
                                 rf"|\btypedef\s+struct\s+{name}\s*\{{")
        return any(pattern.search(self.text(f)) for f in self.files_of(file))

    # -- the page --------------------------------------------------------------------------------------------------

    def read(self) -> None:
        fence = ""
        way: Way | None = None
        for number, line in enumerate((self.root / PAGE).read_text(encoding="utf-8").split("\n"), 1):
            mark = FENCE.match(line)
            if fence:
                if mark and mark.group(1).startswith(fence):
                    fence, way = "", None
                elif way:
                    self.read_line(way, number, line)
            elif mark:
                fence = mark.group(1)
                if mark.group(2) == "way":
                    way = Way(number, "")
                    self.ways.append(way)
            else:
                self.check_paths(number, line)

    def read_line(self, way: Way, number: int, line: str) -> None:
        if not way.title:
            way.line, way.title, way.name = number, line, line
            title = TITLE.match(line)
            if title:
                way.name, way.clauses = title["name"], title["clauses"].split("; ")
            else:
                way.readable = False
                self.complain(number, "a way begins with its title, as in 'PULL, served: one way; 2 files, 2 types'")
            return
        step = STEP.match(line)
        if not step:
            way.readable = False
            self.complain(number, f"'{line.strip()}' is not a step: a mark, a file, a type, and what it decides")
        else:
            way.steps.append(Step(number, step["mark"], step["file"], step["type"], step["words"] or ""))

    def check_paths(self, number: int, line: str) -> None:
        """Paths in the prose, as inline code: with `*` for any name, and {a,b} for several."""
        for code in re.findall(r"`([^`]+)`", line):
            if not PATH.match(code):
                continue
            choices = re.search(r"\{([^{}]*)\}", code)
            each = [code.replace(choices[0], one) for one in choices[1].split(",")] if choices else [code]
            for path in each:
                top = path.split("/")[0]
                if not ((self.root / top).is_dir() or any((self.root / base / top).is_dir() for base in BASES)):
                    continue  # a media type, a noun, what is built
                self.paths += 1
                if top != "build" and not any(any((self.root / base).glob(path.rstrip("/"))) for base in ["", *BASES]):
                    self.complain(number, f"'{path}': there is no such file or folder")

    # -- the ways --------------------------------------------------------------------------------------------------

    def check_step_alone(self, step: Step) -> bool:
        if not (self.root / step.file).is_file():
            self.complain(step.line, f"{step.file}: there is no such file")
            return False
        if not self.declares(step.file, step.type):
            self.complain(step.line, f"{step.file} does not declare {step.type}")
            return False
        return True

    def check_hand_over(self, start: list[Step], by: list[Step], to: Step, named: set[str]) -> None:
        """One of `start` hands over to `to`, directly or by way of `by`."""
        header = self.header_of(to.file)
        if to.mark == "back" and not by:
            return  # a call returns
        if not by:
            if not any(header in self.reach(s.file, named) for s in start):
                self.complain(to.line, f"{start[0].file} does not include {header}")
            return
        last = start
        for step in by:
            if not any(step.file in self.reach(s.file, named) and self.names(s.file, step.type) for s in last):
                self.complain(step.line, f"{last[0].file} does not include {step.file}, or does not use {step.type}")
                return
            last = [step]
        implements = self.names(to.file, step.type) and step.file in {*self.all_includes(to.file), *self.files_of(to.file)}
        leads_to = self.names(step.file, to.type) and header in self.includes(step.file)
        if not implements and not leads_to:
            self.complain(to.line, f"{to.file} does not use {step.type}, and {step.file} does not lead to it")

    def check_steps(self, way: Way) -> None:
        if not all([self.check_step_alone(step) for step in way.steps]):
            return
        named = {f for step in way.steps for f in self.files_of(step.file)}
        start: list[Step] = []  # the last step, and those that it has asked since
        by: list[Step] = []
        for step in way.steps:
            if step.mark == "via":
                by.append(step)
                continue
            if not step.words:
                self.complain(step.line, f"{step.file}: say what it decides")
            if step.mark == "back" and step.file not in {s.file for s in way.steps if s.line < step.line}:
                self.complain(step.line, f"{step.file} is not on the way there")
            if start:
                self.check_hand_over(start, by, step, named)
            start = start + [step] if step.mark == "ask" and start else [step]
            by = []

    def check_title(self, way: Way) -> None:
        steps = [s for s in way.steps if s.mark != "via"]
        turns = [i for i, s in enumerate(steps) if s.mark == "back"]
        if len(turns) != (1 if "there and back" in way.clauses else 0):
            self.complain(way.line, "'there and back' has one 'back', and no other way has any")
            return
        legs = [steps[: turns[0]], steps[turns[0] :]] if turns else [steps]
        twice = sorted({Path(s.file).stem for leg in legs for i, s in enumerate(leg) if s.file in {b.file for b in leg[:i]}})
        told = sorted(name for c in way.clauses if c.startswith("comes back to ") for name in c[14:].split(", "))
        if twice != told:
            what = f"it comes back to {', '.join(twice)}" if twice else "it comes back to no file"
            self.complain(way.line, f"{what}: the title says otherwise")
        if not told and not {"one way", "there and back"} & set(way.clauses):
            self.complain(way.line, "the title says neither 'one way' nor 'there and back' nor 'comes back to'")
        if "one way" in way.clauses and told:
            self.complain(way.line, "one way does not come back")
        if "each boundary once" in way.clauses:
            for leg in legs:
                lands = [LANDS[max((p for p in LANDS if s.file.startswith(p)), key=len)] for s in leg]
                entered = [land for i, land in enumerate(lands) if i == 0 or land != lands[i - 1]]
                if len(set(entered)) != len(entered):
                    self.complain(way.line, f"it crosses a boundary twice: {', '.join(entered)}")
        figures = FIGURES.match(way.clauses[-1]) if way.clauses else None
        files = len({s.file for s in steps})
        types = len({s.type for s in steps if not s.type.endswith("()")})
        if not figures or (int(figures[1]), int(figures[2])) != (files, types):
            self.complain(way.line, f"it has {files} files, {types} types: the title says otherwise")
        most = WANTED.get(way.name)
        if most is not None and max(files, types) > most:
            self.complain(way.line, f"{files} files and {types} types are more than {most}")

    def check(self) -> list[str]:
        self.read()
        for way in self.ways:
            if way.readable:
                before = len(self.violations)
                self.check_steps(way)
                if len(self.violations) == before:
                    self.check_title(way)
        for name in WANTED:
            if name not in {way.name for way in self.ways}:
                self.complain(1, f"the way '{name}' is not drawn")
        return self.violations

    def report(self) -> str:
        lines = [f"way rules: {len(self.ways)} ways, {sum(len(w.steps) for w in self.ways)} steps, {self.paths} paths checked"]
        return "\n".join(lines + [f"  {way.title}" for way in self.ways])


# --- The self-test -------------------------------------------------------------------------------------------------------

CODE = {
    "libcles/include/cles/seam.hpp": "class seam { virtual void on_line() = 0; };\n",
    "libcles/include/cles/all.hpp": "#include <cles/seam.hpp>\n",
    "libcles/include/cles/plugin_side.hpp": "#include <cles/seam.hpp>\nclass plugin_side { seam* s; };\n",
    "libcles/src/node/link.hpp": "#include <cles/all.hpp>\nclass link { seam* owner; };\n",
    "libcles/src/node/link.cpp": '#include "node/link.hpp"\n#include "protocol/line.hpp"\n',
    "libcles/src/protocol/line.hpp": "struct line {};\nvoid parse(line&);\n",
    "libcles/src/protocol/line.cpp": '#include "protocol/line.hpp"\n// class remark {};\n',
    "libcles/src/node/session.hpp": '#include <cles/seam.hpp>\n#include "node/inbound.hpp"\nclass session final : public seam {};\n',
    "libcles/src/node/inbound.hpp": '#include "protocol/line.hpp"\nclass session;\nclass inbound {};\n',
    "runtime/src/jobs/pool.hpp": "#include <cles/seam.hpp>\nclass pool { seam* s; };\n",
}
LINK, LINE, SEAM = "libcles/src/node/link.cpp", "libcles/src/protocol/line.cpp", "libcles/include/cles/seam.hpp"
SESSION, INBOUND = "libcles/src/node/session.hpp", "libcles/src/node/inbound.hpp"
POOL, PLUGIN = "runtime/src/jobs/pool.hpp", "libcles/include/cles/plugin_side.hpp"

# The first block of a good page; what is planted takes its place.
SERVED = ["PULL, served: there and back; 4 files, 4 types", f"     {LINK} link  reads", f"ask  {LINE}  line  splits",
          f"via  {SEAM} seam", f"     {SESSION}  session  decides", f"     {INBOUND}  inbound  runs",
          f"back {INBOUND}  inbound  replies", f"ask  {LINE}  parse()  is the other direction"]


def good_page(served: list[str], prose: str = "") -> str:
    others = [[f"{name}: one way; 1 files, 1 types", f"     {LINE}  line  splits"] for name in WANTED if name != "PULL, served"]
    others[-1] = ["DELEGATE in clesd: there and back; each boundary once; 3 files, 3 types", f"     {SESSION}  session  decides",
                  f"via  {SEAM} seam", f"     {POOL}  pool  queues", f"via  {SEAM}  seam", f"     {PLUGIN}  plugin_side  runs",
                  f"via  {SEAM}  seam", f"back {POOL}  pool  collects", f"via  {SEAM}  seam", f"     {SESSION}  session  replies"]
    blocks = "".join("\n```way\n" + "\n".join(way) + "\n```\n" for way in [served, *others])
    return f"# Ways\n\nSee `libcles/src/node/`, `node/{{link,session}}.*`, `text/plain`.\n{prose}{blocks}\n```\nway: no block\n```\n"


def replaced(index: int, *lines: str) -> list[str]:
    return SERVED[:index] + list(lines) + SERVED[index + 1 :]


# (the first block, what is complained of)
PLANTED = [
    (["PULL, served"] + SERVED[1:], "begins with its title"),
    (replaced(1, "link reads"), "is not a step"),
    (replaced(2, "ask  libcles/src/protocol/gone.cpp  line  splits"), "there is no such file"),
    (replaced(2, f"ask  {LINE}  remark  splits"), "does not declare remark"),
    (replaced(5, f"     {INBOUND}  session  runs"), "does not declare session"),
    (replaced(2, f"ask  {LINE}  read()  splits"), "does not declare read()"),
    (replaced(2, f"ask  {LINE}  line"), "say what it decides"),
    (replaced(4, f"     {SESSION}  session  decides", f"ask  {LINK}  link  is asked"), "does not include libcles/src/node/link.hpp"),
    (SERVED[:3] + SERVED[4:], "does not include libcles/src/node/session.hpp"),
    (SERVED[:5] + [f"via  {SEAM} seam"] + SERVED[5:], "inbound.hpp does not use seam"),
    (SERVED[:6] + [f"via  {SEAM} seam"] + SERVED[6:], "or does not use seam"),
    (SERVED[:2] + SERVED[3:6] + [f"back {LINE}  line  is the other direction"], "is not on the way there"),
    (replaced(0, "PULL, served: one way; 4 files, 4 types"), "has one 'back'"),
    (["PULL, served: one way; 3 files, 3 types", SERVED[1], SERVED[2], SERVED[3], SERVED[4], f"via  {SEAM} seam", SERVED[1]],
     "it comes back to link: the title says otherwise"),
    (replaced(0, "PULL, served: there and back; comes back to link; 4 files, 4 types"), "it comes back to no file"),
    (["PULL, served: one way; comes back to link; 3 files, 3 types", SERVED[1], SERVED[2], SERVED[3], SERVED[4],
      f"via  {SEAM} seam", SERVED[1]], "one way does not come back"),
    (["PULL, served: 1 files, 1 types", SERVED[1]], "says neither"),
    (replaced(0, "PULL, served: there and back; 4 files, 5 types"), "it has 4 files, 4 types"),
    (replaced(0, "PULL, served: there and back"), "it has 4 files, 4 types"),
    (replaced(0, "PULL, swerved: there and back; 4 files, 4 types"), "the way 'PULL, served' is not drawn"),
    (["PULL, served: comes back to session; each boundary once; 2 files, 2 types", f"     {SESSION} session  decides",
      f"via  {SEAM} seam", f"     {POOL} pool  queues", f"via  {SEAM} seam", f"     {SESSION}  session  decides"],
     "it crosses a boundary twice"),
]
PLANTED_PROSE = [
    ("See `libcles/src/core/`.\n", "'libcles/src/core/': there is no such file or folder"),
    ("See `node/{link,shell}.hpp`.\n", "'node/shell.hpp': there is no such file or folder"),
    ("See `runtime/src/jobs/*.cpp`.\n", "'runtime/src/jobs/*.cpp': there is no such file or folder"),
]


def self_test() -> int:
    failures = []

    def check(page: str, limit: int | None = None) -> list[str]:
        with tempfile.TemporaryDirectory() as scratch:
            write_tree(Path(scratch), {**CODE, PAGE: page})
            before = WANTED["PULL, served"]
            WANTED["PULL, served"] = limit or before
            try:
                return Page(Path(scratch)).check()
            finally:
                WANTED["PULL, served"] = before

    failures += [f"found in a page that keeps the rules: {v}" for v in check(good_page(SERVED))]
    planted = [(way[0], check(good_page(way)), expected) for way, expected in PLANTED]
    planted += [(prose, check(good_page(SERVED, prose)), expected) for prose, expected in PLANTED_PROSE]
    planted += [("a limit", check(good_page(SERVED), 3), "are more than 3")]
    for title, found, expected in planted:
        if len(found) != 1 or expected not in found[0]:
            failures.append(f"{title!r}: expected one '{expected}', found {found}")
    for failure in failures:
        print(failure)
    print(f"way rules, self-test: {len(planted)} violations planted, {len(failures)} mistakes")
    return 1 if failures else 0


def main(arguments: list[str]) -> int:
    if arguments == ["--self-test"]:
        return self_test()
    page = Page(Path(arguments[0] if arguments else Path(__file__).parents[2]))
    for violation in page.check():
        print(violation)
    print(page.report())
    return 1 if page.violations else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
