#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks rules for every file of the project: licence line, white space, words, links, the names of suites.

    text_rules.py [ROOT]        checks the tree; prints each violation; exits 1 where there is one
    text_rules.py --self-test   plants violations in a scratch tree and expects to find every one of them
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.parse import unquote

SPDX = "SPDX-License-Identifier: BSL-1.0"
SLASH_SUFFIXES = {".cpp", ".hpp", ".h", ".ipp"}
HASH_SUFFIXES = {".py", ".sh", ".cmake", ".yaml", ".yml", ".toml", ".service"}
HASH_NAMES = {"CMakeLists.txt", ".clang-format", ".clang-tidy"}
# Files that cannot contain a comment, or are not ours to mark.
UNMARKED = {"LICENSE", ".gitignore", ".gitattributes"}
# Inputs of tests, which are as they are.
DATA = "test/fuzz/corpus/"
SKIPPED_FOLDERS = {".git", "build", ".cache", "__pycache__"}

# Written apart, so that this file does not find itself.
UNFINISHED = re.compile(r"\b(" + "|".join(["TO" + "DO", "FIX" + "ME", "XX" + "X", "HA" + "CK"]) + r")\b")
MACHINE_PATH = re.compile(r"(?<![\w.~}$/-])/(wo" + r"rk|ro" + r"ot)/")
REGISTRY = re.compile(r"\b(deb\.deb" + r"ian\.org|registry\.n" + r"pmjs\.org|py" + r"pi\.org)\b")
MACHINE_WRITER = re.compile(
    r"\b(A" + r"I[ -](assistant|agent|session|generated|written|helper)|sess" + r"ion of an A" + r"I"
    r"|(large )?language mo" + r"del|Cla" + r"ude|Anth" + r"ropic|Chat" + r"GPT|Open" + r"AI|Copi" + r"lot)\b"
)
WORDS = [
    (UNFINISHED, "finish it, or leave it out"),
    (MACHINE_PATH, "a path of one machine"),
    (REGISTRY, "a package host: name the package alone"),
    (MACHINE_WRITER, "says how it was written, not what it does"),
]

FENCE = re.compile(r"^ {0,3}(```+|~~~+)")
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\[\]]*\])*\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)")
REFERENCE = re.compile(r"^ {0,3}\[[^\]^][^\]]*\]:\s*<?(\S+?)>?(?:\s+\"[^\"]*\")?\s*$")
HEADING = re.compile(r"^ {0,3}#{1,6}\s+(.*?)\s*#*\s*$")
ANCHOR = re.compile(r"<a\s+(?:id|name)=\"([^\"]+)\"")


def files_of(root: Path) -> list[Path]:
    """The files that belong to the project: what git knows or would take; without git, all but what was built."""
    if (root / ".git").exists():
        done = subprocess.run(
            ["git", "-C", str(root), "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            capture_output=True, check=False)
        if done.returncode == 0:
            names = [n for n in done.stdout.decode().split("\0") if n]
            return sorted(p for p in (root / n for n in set(names)) if p.is_file() and not p.is_symlink())
    return sorted(p for p in root.rglob("*")
                  if p.is_file() and not p.is_symlink() and not SKIPPED_FOLDERS & set(p.relative_to(root).parts))


def prose_lines(text: str):
    """(line number, line) of Markdown outside code fences, with inline code blanked."""
    fence = ""
    for number, line in enumerate(text.split("\n"), 1):
        mark = FENCE.match(line)
        if fence:
            if mark and mark.group(1).startswith(fence):
                fence = ""
            continue
        if mark:
            fence = mark.group(1)
            continue
        yield number, re.sub(r"(`+)(?!`).+?(?<!`)\1(?!`)", "``", line)


def anchors_of(text: str) -> set[str]:
    """The anchors that a Markdown page offers, made of its headings as GitHub makes them."""
    anchors: set[str] = set(ANCHOR.findall(text))
    fence = ""
    for line in text.split("\n"):
        mark = FENCE.match(line)
        if mark:
            fence = "" if fence and mark.group(1).startswith(fence) else fence or mark.group(1)
        heading = None if fence else HEADING.match(line)
        if heading:
            title = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.group(1)).replace("`", "").replace("*", "")
            slug = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
            unique, count = slug, 0
            while unique in anchors:
                count += 1
                unique = f"{slug}-{count}"
            anchors.add(unique)
    return anchors


class Texts:
    def __init__(self, root: Path):
        self.root = root
        self.violations: list[str] = []
        self.texts: dict[str, str] = {}
        for path in files_of(root):
            name = path.relative_to(root).as_posix()
            data = path.read_bytes()
            if b"\0" not in data and not name.startswith(DATA):
                self.texts[name] = data.decode("utf-8", errors="replace")

    def complain(self, name: str, line: int, what: str) -> None:
        self.violations.append(f"{name}:{line}: {what}")

    def check_licence(self, name: str, lines: list[str]) -> None:
        path = Path(name)
        shebang = lines[0].startswith("#!")
        if path.suffix in SLASH_SUFFIXES:
            wanted = f"// {SPDX}"
        elif path.suffix in HASH_SUFFIXES or path.name in HASH_NAMES or shebang:
            wanted = f"# {SPDX}"
        else:
            return
        if path.name in UNMARKED:
            return
        at = 1 if shebang else 0
        if len(lines) <= at or lines[at] != wanted:
            self.complain(name, at + 1, f"this line must be '{wanted}'")

    def check_white_space(self, name: str, lines: list[str]) -> None:
        for number, line in enumerate(lines, 1):
            if line != line.rstrip():
                self.complain(name, number, "white space at the end of the line")
            if "\t" in line and Path(name).suffix in SLASH_SUFFIXES | {".py", ".cmake"}:
                self.complain(name, number, "a tab")
            if "\ufffd" in line:
                self.complain(name, number, "not UTF-8")
        if lines[-1] != "":
            self.complain(name, len(lines), "no newline at the end of the file")
        elif len(lines) > 2 and lines[-2] == "":
            self.complain(name, len(lines) - 1, "an empty line at the end of the file")

    def check_words(self, name: str, lines: list[str]) -> None:
        for number, line in enumerate(lines, 1):
            for pattern, what in WORDS:
                found = pattern.search(line)
                if found:
                    self.complain(name, number, f"'{found.group(0)}': {what}")

    def check_links(self, name: str, text: str) -> None:
        for number, line in prose_lines(text):
            targets = [m.group(1) for m in LINK.finditer(line)] + [m.group(1) for m in REFERENCE.finditer(line)]
            for target in targets:
                if re.match(r"[a-z][a-z0-9+.-]*:", target):
                    continue
                file, _, anchor = unquote(target).partition("#")
                path = (self.root / name).parent / file if not file.startswith("/") else self.root / file[1:]
                if file and not path.exists():
                    self.complain(name, number, f"the link to '{target}' leads nowhere")
                elif anchor and (not file or path.suffix == ".md"):
                    page = text if not file else path.read_text(encoding="utf-8")
                    if anchor not in anchors_of(page):
                        self.complain(name, number, f"the link to '{target}': there is no such heading")

    def check_suite(self, name: str, text: str) -> None:
        """The build runs `foo_test.cpp` as the suite `foo`: cases outside it would never run."""
        opened = [(m.start(), m.group(2)) for m in
                  re.finditer(r"^[ \t]*(BOOST_AUTO|BOOST_FIXTURE|CLES)_TEST_SUITE\(\s*(\w+)", text, re.MULTILINE)]
        closed = [m.start() for m in re.finditer(r"^[ \t]*BOOST_AUTO_TEST_SUITE_END\(", text, re.MULTILINE)]
        cases = [m.start() for m in
                 re.finditer(r"^[ \t]*BOOST_(AUTO_TEST_CASE\w*|FIXTURE_TEST_CASE\w*|DATA_TEST_CASE\w*)\(", text, re.MULTILINE)]
        wanted = Path(name).stem.removesuffix("_test")
        if not opened or opened[0][1] != wanted:
            self.complain(name, 1, f"its suite must be BOOST_AUTO_TEST_SUITE({wanted}), as the file is named")
            return
        depth = 0
        for at, kind in sorted([(at, "open") for at, _ in opened] + [(at, "close") for at in closed]
                               + [(at, "case") for at in cases]):
            outermost_again = kind == "open" and depth == 0 and at != opened[0][0]
            if outermost_again or (kind == "case" and depth == 0):
                self.complain(name, text.count("\n", 0, at) + 1, f"outside the suite {wanted}: it would never run")
            depth += {"open": 1, "close": -1, "case": 0}[kind]

    def check(self) -> list[str]:
        for name, text in self.texts.items():
            if not text:
                continue
            lines = text.split("\n")
            self.check_licence(name, lines)
            self.check_white_space(name, lines)
            self.check_words(name, lines)
            if name.endswith(".md"):
                self.check_links(name, text)
            if re.match(r"test/(unit|golden|simulation|contract|integration|runtime)/\w+_test\.cpp$", name):
                self.check_suite(name, text)
        return self.violations


# --- The self-test -------------------------------------------------------------------------------------------------------

GOOD = {
    "a.cpp": f"// {SPDX}\nint a;\n",
    "CMakeLists.txt": f"# {SPDX}\n",
    "scripts/run": f"#!/bin/sh\n# {SPDX}\n",
    "data.json": "{}\n",
    "test/unit/line_test.cpp": f"// {SPDX}\nBOOST_AUTO_TEST_SUITE(line)\nBOOST_AUTO_TEST_CASE(a) {{}}\n"
    "BOOST_AUTO_TEST_SUITE(inner)\nBOOST_AUTO_TEST_SUITE_END()\nBOOST_AUTO_TEST_SUITE_END()\n",
    "test/unit/url_test.cpp": f"// {SPDX}\nCLES_TEST_SUITE(url)\nBOOST_AUTO_TEST_CASE(a) {{}}\nBOOST_AUTO_TEST_SUITE_END()\n",
    "README.md": "# CLES\n\n## What `it` is, and why\n\n[a](docs/b.md) [b](docs/b.md#one-two) [c](#what-it-is-and-why)\n"
    "[web](https://example.org/x) `[code](nowhere.md)`\n\n```\n[code](nowhere.md)\n# no heading\n```\n\n[r]: a.cpp\n",
    "test/fuzz/corpus/json/spaces": " {} ",
    "docs/b.md": "# B\n\n## One, two\n\n[up](../README.md)\n",
}

PLANTED = [
    ("b.cpp", "int b;\n", "this line must be '// SPDX"),
    ("b.cmake", "set(x)\n", "this line must be '# SPDX"),
    ("run", f"#!/bin/sh\necho\n# {SPDX}\n", "this line must be '# SPDX"),
    ("b.txt", "one \n", "white space at the end"),
    ("b.txt", "one", "no newline at the end"),
    ("b.txt", "one\n\n", "an empty line at the end"),
    ("b.cpp", f"// {SPDX}\n\tint b;\n", "a tab"),
    ("b.txt", "TO" + "DO: more\n", "finish it"),
    ("b.txt", "see /wo" + "rk/main\n", "a path of one machine"),
    ("b.txt", "from deb.deb" + "ian.org\n", "a package host"),
    ("b.txt", "by an A" + "I assistant\n", "says how it was written"),
    ("b.md", "[x](nowhere.md)\n", "leads nowhere"),
    ("b.md", "[x](docs/b.md#three)\n", "no such heading"),
    ("b.md", "[x](#no)\n", "no such heading"),
    ("b.md", "[x]: nowhere.md\n", "leads nowhere"),
    ("test/unit/b_test.cpp", f"// {SPDX}\nBOOST_AUTO_TEST_SUITE(c)\nBOOST_AUTO_TEST_SUITE_END()\n", "its suite must be"),
    ("test/unit/b_test.cpp",
     f"// {SPDX}\nBOOST_AUTO_TEST_SUITE(b)\nBOOST_AUTO_TEST_SUITE_END()\nBOOST_AUTO_TEST_CASE(x) {{}}\n", "would never run"),
]


def self_test() -> int:
    failures = []

    def check(files: dict[str, str]) -> list[str]:
        with tempfile.TemporaryDirectory() as scratch:
            for name, text in files.items():
                path = Path(scratch) / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text, encoding="utf-8")
            return Texts(Path(scratch)).check()

    failures += [f"found in a tree that keeps the rules: {v}" for v in check(GOOD)]
    for name, text, expected in PLANTED:
        found = check({**GOOD, name: text})
        if len(found) != 1 or not found[0].startswith(name) or expected not in found[0]:
            failures.append(f"{name}: {text[:60]!r}: expected one '{expected}', found {found}")
    for failure in failures:
        print(failure)
    print(f"text rules, self-test: {len(PLANTED)} violations planted, {len(failures)} mistakes")
    return 1 if failures else 0


def main(arguments: list[str]) -> int:
    if arguments == ["--self-test"]:
        return self_test()
    texts = Texts(Path(arguments[0] if arguments else Path(__file__).parents[2]))
    for violation in texts.check():
        print(violation)
    print(f"text rules: {len(texts.texts)} files checked, {len(texts.violations)} violations")
    return 1 if texts.violations else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
