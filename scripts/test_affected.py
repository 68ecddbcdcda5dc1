#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Says which tests a change affects: those of which something has changed since they last passed. `scripts/test --affected`
calls it with a folder of the build, and with the arguments for ctest, which may select some of the tests.

    test_affected.py targets BUILD [ARGUMENT...]   prints what has to be built for these tests
    test_affected.py select BUILD [ARGUMENT...]    prints a pattern for `ctest -R`, or nothing if none of them is affected
    test_affected.py record BUILD                  remembers which of the selected tests passed, from BUILD/tests.xml
    test_affected.py forget BUILD                  forgets those that failed, from BUILD/tests.xml of a run without `select`
    test_affected.py --self-test

A test depends on
- the files that its command and its environment name, and for a program also the plugins and programs that its target
  depends on, and the files that are compiled into it as names;
- the programs and plugins in a folder of the build that it is given; with apps/, or all of the build, on all of them except
  those of tests, since from there a script finds the others;
- the files of a folder of the sources that it is given. With the root, on all of them; or, if it uses programs, on those
  outside of test/, since such a test installs, or starts, what users have;
- the Python modules that its script imports, the files and folders that it quotes, and what these use in turn;
- files beside its sources that are not code, such as recordings.

Contents count, not times. A program that is linked again, and is the same, affects nothing. It cannot know other files that
a test opens, under names that it computes; nor what belongs to the system: compilers, libraries, the interpreter.
"""

import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from bisect import bisect_left
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
STATE = ".affected.json"
COMPILED = (".cpp", ".hpp", "CMakeLists.txt")
CODE = (*COMPILED, ".py")
QUOTED = r"""(?:"[^"\n]+"|'[^'\n]+')"""
HOW_IT_IS_SCHEDULED = {"COST", "LABELS", "PROCESSORS", "RUN_SERIAL", "TIMEOUT"}


class Tree:
    """The files of the sources, by absolute path."""

    def __init__(self, root: Path):
        self.root = str(root)
        self.files = sorted(f"{self.root}/{file}" for file in self._listed())
        self.all = set(self.files)
        self.by_name: dict[str, list[str]] = {}
        self.modules: dict[str, list[str]] = {}
        for file in self.files:
            folder, name = os.path.split(file)
            # What has neither a suffix nor may be run is not found by its name, which is a word.
            if not name.endswith(COMPILED) and ("." in name or os.access(file, os.X_OK)):
                self.by_name.setdefault(name, []).append(file)
            if name.endswith(".py"):
                self.modules.setdefault(name[:-3], []).append(file)
                self.modules.setdefault(os.path.basename(folder), []).append(file)  # a package
        self._used: dict[str, set[str]] = {}

    def _listed(self) -> list[str]:
        command = ["git", "-C", self.root, "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        if os.path.exists(f"{self.root}/.git"):
            return [name for name in subprocess.check_output(command, text=True).split("\0") if name]
        found = []
        for folder, folders, names in os.walk(self.root):
            folders[:] = [each for each in folders if each not in ("build", "__pycache__")]
            found += [os.path.relpath(os.path.join(folder, name), self.root) for name in names]
        return found

    def beneath(self, folder: str) -> list[str]:
        return self.files[bisect_left(self.files, folder + "/") : bisect_left(self.files, folder + "0")]  # "0" follows "/"

    def data_beneath(self, folder: str) -> list[str]:
        return [file for file in self.beneath(folder) if not file.endswith(CODE)]

    def is_script(self, file: str) -> bool:
        if "." in os.path.basename(file) or not os.access(file, os.X_OK):
            return file.endswith(".py")
        with open(file, "rb") as opened:
            return b"python" in opened.readline()

    def used_by(self, script: str) -> set[str]:
        """The files of the tree that a Python script imports, or quotes. Only the script knows where it looks for them, so
        these are all with that name."""
        if script not in self._used:
            used = set()
            try:
                text = Path(script).read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError):
                text = ""
            for one, several in re.findall(r"^[ \t]*(?:from[ \t]+([\w.]+)|import[ \t]+([\w., \t]+))", text, re.MULTILINE):
                for module in (one or several).split(","):
                    name = module.strip().partition(" ")[0]
                    if name.startswith("."):
                        used.update(file for file in self.beneath(os.path.dirname(script)) if file.endswith(".py"))
                    for part in name.split("."):
                        used.update(self.modules.get(part, []))
            for path in re.findall(rf"{QUOTED}(?:\s*[/,]\s*{QUOTED})*", text):  # of one part, or of several that are joined
                parts = [part.strip("\"'") for part in re.findall(QUOTED, path)]
                for part in parts:
                    used.update(self.by_name.get(part.rpartition("/")[2], []))
                place = "/".join(parts).strip("/")
                if "/" in place:  # "test" alone may be anything
                    used.update(self.beneath(f"{self.root}/{place}"))
            self._used[script] = used
        return self._used[script]

    def with_used(self, files: set[str]) -> set[str]:
        """These files, and what the scripts among them use."""
        found, left = set(), list(files)
        while left:
            file = left.pop()
            if file not in found:
                found.add(file)
                if self.is_script(file):
                    left += self.used_by(file)
        return found


class Build:
    """What ninja builds, by absolute path."""

    LINKED = re.compile(r"[A-Z]+_(EXECUTABLE|MODULE_LIBRARY|SHARED_LIBRARY)_LINKER")
    ARCHIVE = re.compile(r"[A-Z]+_STATIC_LIBRARY_LINKER")

    def __init__(self, folder: Path, tree: Tree):
        self.folder = str(folder)
        self.tree = tree
        self.programs: set[str] = set()  # and plugins
        self.archives: set[str] = set()
        self.inputs: dict[str, list[str]] = {}
        self.named: dict[str, list[str]] = {}  # by objects: what is compiled into them as a name
        outputs: list[str] = []
        for line in (folder / "build.ninja").read_text(encoding="utf-8").splitlines():
            if line.startswith("build "):
                outputs = self._statement(line[6:])
            elif line.startswith("  DEFINES = "):
                for output in outputs:
                    self.named[output] = re.findall(r'\\"(/[^"\\]*)', line)
        self._needs: dict[str, set[str]] = {}
        self._folders: dict[str, set[str]] = {}

    def _statement(self, text: str) -> list[str]:
        words = re.findall(r"(?:\$.|[^\s$])+", text)
        end = next(at for at, word in enumerate(words) if word.endswith(":"))
        words[end] = words[end][:-1]
        outputs = [self._path(word) for word in words[: end + 1] if word != "|"]
        rule = words[end + 1]
        inputs = [self._path(word) for word in words[end + 2 :] if word not in ("|", "||")]
        for output in outputs:
            self.inputs[output] = inputs
            if self.LINKED.match(rule):
                self.programs.add(output)
            elif self.ARCHIVE.match(rule):
                self.archives.add(output)
        return outputs

    def _path(self, word: str) -> str:
        return os.path.normpath(os.path.join(self.folder, re.sub(r"\$(.)", r"\1", word)))

    def reached_from(self, folder: str) -> set[str]:
        """The programs that a test finds which is given this folder."""
        if folder not in (self.folder, f"{self.folder}/apps"):
            return {each for each in self.programs if each.startswith(folder + "/")}
        archives = self.archives if folder == self.folder else set()
        return {each for each in self.programs | archives if not each.startswith(f"{self.folder}/test/")}

    def needs(self, program: str) -> set[str]:
        """What a program may use when it runs: other programs, and files of the tree."""
        if program not in self._needs:
            needs, seen, left = set(), {program}, list(self.inputs.get(program, []))
            while left:
                each = left.pop()
                if each in seen:
                    continue
                seen.add(each)
                inputs = self.inputs.get(each, [])
                left += inputs
                if each in self.programs:
                    needs.add(each)
                elif each.endswith(".o"):
                    for name in self.named.get(each, []):
                        needs.update(self._named(name))
                    for folder in set().union(*map(self._folders_of, inputs[:1])):
                        needs.update(self.tree.data_beneath(folder))
            self._needs[program] = needs
        return self._needs[program]

    def _named(self, name: str) -> set[str]:
        if name.startswith(f"{self.folder}/"):
            return {name} if name in self.programs else self.reached_from(name)
        return {name} & self.tree.all

    def _folders_of(self, source: str) -> set[str]:
        """The folder of a test's source; of a source of the build, which includes several, those of all of them."""
        if source not in self._folders:
            sources = [source]
            if source.startswith(f"{self.folder}/") and os.path.exists(source):
                included = re.findall(r'^#include "(.*)"', Path(source).read_text(encoding="utf-8"), re.MULTILINE)
                sources = [f"{self.tree.root}/{each}" for each in included]
            self._folders[source] = {os.path.dirname(each) for each in sources if each.startswith(f"{self.tree.root}/test/")}
        return self._folders[source]


class Test:
    """A test of ctest: what it depends on."""

    def __init__(self, description: dict, tree: Tree, build: Build):
        self.name = description["name"]
        self.files: set[str] = set()
        self.targets: set[str] = set()
        properties = {each["name"]: each["value"] for each in description.get("properties", [])}
        command = description.get("command", [])
        self.how = json.dumps([command, {name: value for name, value in properties.items() if name not in HOW_IT_IS_SCHEDULED}])
        if not command:  # ctest does not find the program: it is yet to be built
            self.targets.add("all")
        words = list(command)
        for variable in properties.get("ENVIRONMENT", []):
            name, _, value = variable.partition("=")
            if name == "PYTHONPATH":  # its modules are those that are imported; but this one is, always
                self.files.update({f"{folder}/sitecustomize.py" for folder in value.split(":")} & tree.all)
            else:
                words.append(value)
        named = {os.path.normpath(part) for word in words for part in [word, *re.split("[=:;,]", word)] if part.startswith("/")}

        for path in sorted(named):
            if path in build.programs:
                self.targets.add(path)
            elif path == build.folder:
                self.targets.add("all")
                self.files |= build.reached_from(path)
            elif path.startswith(f"{build.folder}/"):
                if path in build.inputs:  # made from others
                    self.targets.add(path)
                elif os.path.isfile(path):
                    self.files.add(path)
                else:
                    self.targets |= build.reached_from(path)
        for program in self.targets - {"all"}:
            self.files |= {program} | build.needs(program)

        of_tree = named & tree.all
        for script in of_tree:
            if script.endswith(".py"):
                self.files.update(tree.data_beneath(os.path.dirname(script)))
        for path in named:
            if path == tree.root:
                without = f"{tree.root}/test/" if self.targets else None
                self.files.update(file for file in tree.files if without is None or not file.startswith(without))
            elif not path.startswith(f"{build.folder}/"):
                self.files.update(tree.beneath(path))
        self.files |= {f"{tree.root}/test/environment.cmake"} & tree.all  # ctest reads it
        # What a folder contains may be in Python too. Not the root: there is nothing else to find.
        self.files |= tree.with_used(of_tree | {file for file in self.files if tree.root not in named})


class State:
    """What is remembered between runs: digests of files, and with which digest of all that it depends on a test passed."""

    def __init__(self, build: Path):
        self.file = build / STATE
        self.digests: dict[str, list] = {}
        self.passed: dict[str, str] = {}
        self.selected: dict[str, str] = {}
        try:
            self.digests, self.passed, self.selected = json.loads(self.file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            pass

    def write(self) -> None:
        new = self.file.with_suffix(".new")
        new.write_text(json.dumps([self.digests, self.passed, self.selected]), encoding="utf-8")
        new.replace(self.file)

    def read(self, files: set[str]) -> None:
        """Brings the digests of these up to date."""

        def digest(file: str) -> tuple[str, list]:
            try:
                status = os.stat(file)
                times = [status.st_mtime_ns, status.st_ctime_ns, status.st_size]
                known = self.digests.get(file)
                if known and known[:3] == times:
                    return file, known
                content = hashlib.sha1(usedforsecurity=False)
                with open(file, "rb") as opened:
                    while part := opened.read(1 << 20):
                        content.update(part)
                return file, [*times, content.hexdigest()]
            except OSError:
                return file, [0, 0, 0, "missing"]

        with ThreadPoolExecutor(os.cpu_count()) as several:
            self.digests.update(several.map(digest, sorted(files)))

    def digest_of(self, test: Test) -> str:
        whole = hashlib.sha1(test.how.encode(), usedforsecurity=False)
        for file in sorted(test.files):
            whole.update(f"{file} {self.digests[file][3]}\n".encode())
        return whole.hexdigest()


# --- The commands --------------------------------------------------------------------------------------------------------


def tests_of(build: Path, arguments: list[str], root: Path) -> list[Test]:
    listed = subprocess.check_output(
        ["ctest", "--test-dir", str(build), "--show-only=json-v1", *arguments], stderr=subprocess.DEVNULL)
    return described(json.loads(listed)["tests"], build, root)


def described(descriptions: list[dict], build: Path, root: Path) -> list[Test]:
    tree = Tree(root)
    built = Build(build, tree)
    return [Test(each, tree, built) for each in descriptions]


def targets(tests: list[Test], build: Path) -> list[str]:
    found = set().union(*(test.targets for test in tests))
    return ["all"] if "all" in found else sorted(os.path.relpath(each, build) for each in found)


def select(tests: list[Test], build: Path) -> list[str]:
    state = State(build)
    state.read(set().union(*(test.files for test in tests)))
    state.selected = {}
    for test in tests:
        digest = state.digest_of(test)
        if state.passed.get(test.name) != digest:
            state.selected[test.name] = digest
    state.write()
    (build / "tests.xml").unlink(missing_ok=True)  # so that no older results are taken for those of this run
    return list(state.selected)


def record(build: Path, were_selected: bool = True) -> None:
    state = State(build)
    try:
        results = ElementTree.parse(build / "tests.xml")
    except (OSError, ElementTree.ParseError):
        return
    for case in results.iter("testcase"):
        name = case.get("name", "")
        if case.get("status") != "run":
            state.passed.pop(name, None)
        elif were_selected and name in state.selected:
            state.passed[name] = state.selected[name]
    state.write()


def pattern_of(names: list[str]) -> str:
    return "^(" + "|".join(map(re.escape, names)) + ")$" if names else ""


# --- The self-test -------------------------------------------------------------------------------------------------------

NINJA = """
rule CXX_EXECUTABLE_LINKER__tool_Debug
build own_test.o: CXX_COMPILER__own_Debug {root}/test/own/own_test.cpp || order
  DEFINES = -DFOLDER=\\"{build}/test/made\\" -DMODEL=\\"{root}/test/model.pml\\"
build unit_0.o: CXX_COMPILER__own_Debug {build}/units/unit_0.cpp || order
build order: phony || apps/loaded.so
build apps/loaded.so: CXX_MODULE_LIBRARY_LINKER__loaded_Debug loaded.o
build libone.a: CXX_STATIC_LIBRARY_LINKER__one_Debug one.o
build test/made/faulty.so: CXX_MODULE_LIBRARY_LINKER__faulty_Debug faulty.o
build test/own: CXX_EXECUTABLE_LINKER__own_Debug own_test.o unit_0.o | libone.a || libone.a order
build apps/tool: CXX_EXECUTABLE_LINKER__tool_Debug tool.cpp.o | libone.a
build perf/with$ space$:colon: CXX_EXECUTABLE_LINKER__perf_Debug perf.o
build all: phony test/own apps/tool
"""
SOURCES = {
    "test/environment.cmake": "", "test/own/own_test.cpp": "", "test/own/recorded/a.txt": "", "test/model.pml": "",
    "build/units/unit_0.cpp": '#include "test/other/other_test.cpp"\n', "test/other/recorded.json": "",
    "test/cli/top_test.py":
        "import os, support\nsubprocess.run(['plot.py', ROOT / 'scripts' / 'evaluate'])\nROOT / \"docs\" / 'pages'\n",
    "test/cli/names_test.py": "from shown.page import Page\n",
    "test/cli/support.py": "", "test/docs/shown/page.py": "import deeper\n", "test/docs/deeper.py": "", "perf/plot.py": "",
    "scripts/evaluate": "#!/usr/bin/env python3\nimport figures\n", "perf/figures.py": "", "docs/pages/b.md": "",
    "perf/inputs/in": "", "test/cli/recorded/c.txt": "",
    "test/support/isolated": "", "test/support/python/sitecustomize.py": "", "test/rules/rules.py": "", "docs/a.md": "",
    "perf/evaluation/latency.py": "", "test/consumers/consumer_test.py": ""}
BUILT = ("apps/loaded.so", "libone.a", "test/made/faulty.so", "test/own", "apps/tool", "perf/with space:colon")
TESTS = {
    "own": ["{root}/test/support/isolated", "{build}/test/own", "--run_test=own"],
    "folder": ["{build}/perf", "{root}/perf/inputs"],
    "top": ["{root}/test/support/isolated", "/usr/bin/python3", "{root}/test/cli/top_test.py"],
    "names": ["/usr/bin/python3", "{root}/test/cli/names_test.py"],
    "latency": ["/usr/bin/python3", "{root}/perf/evaluation/../evaluation/latency.py", "{build}/apps"],
    "rules": ["/usr/bin/python3", "{root}/test/rules/rules.py", "{root}"],
    "consumers": ["/usr/bin/python3", "{root}/test/consumers/consumer_test.py", "--source={root}", "{build}"],
    "none": ["/usr/bin/true"]}
ENVIRONMENT = {"top": ["TOOL={build}/apps/tool", "PYTHONPATH={root}/test/support/python:{root}/test/docs"]}
ALL = set(TESTS)
# What changes, and which tests it affects.
CHANGES = {
    "build/apps/tool": {"top", "latency", "consumers"},
    "build/test/own": {"own"},
    "build/apps/loaded.so": {"own", "latency", "consumers"},
    "build/test/made/faulty.so": {"own"},
    "build/perf/with space:colon": {"folder", "latency", "consumers"},
    "build/libone.a": {"consumers"},
    "test/model.pml": {"own", "rules"},
    "test/own/recorded/a.txt": {"own", "rules"},
    "test/own/own_test.cpp": {"rules"},
    "test/other/recorded.json": {"own", "rules"},
    "test/cli/top_test.py": {"top", "rules"},
    "test/cli/support.py": {"top", "rules"},
    "perf/plot.py": {"top", "rules", "consumers"},
    "scripts/evaluate": {"top", "rules", "consumers"},
    "perf/figures.py": {"top", "rules", "consumers"},
    "docs/pages/b.md": {"top", "rules", "consumers"},
    "perf/inputs/in": {"folder", "rules", "consumers"},
    "test/cli/recorded/c.txt": {"top", "names", "rules"},
    "test/docs/deeper.py": {"names", "rules"},
    "test/support/isolated": {"own", "top", "rules"},
    "test/support/python/sitecustomize.py": {"top", "rules"},
    "test/environment.cmake": ALL,
    "perf/evaluation/latency.py": {"latency", "rules", "consumers"},
    "test/consumers/consumer_test.py": {"consumers", "rules"},
    "docs/a.md": {"rules", "consumers"},
    "docs/new.md": {"rules", "consumers"}}


def self_test() -> int:
    mistakes = []

    def expect(what: str, found: object, expected: object) -> None:
        if found != expected:
            mistakes.append(f"{what}: {found!r} instead of {expected!r}")

    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder).resolve()
        build = root / "build"
        for name, text in {**SOURCES, **{f"build/{each}": each for each in BUILT}}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        (root / "scripts/evaluate").chmod(0o755)
        (build / "build.ninja").write_text(NINJA.format(root=root, build=build), encoding="utf-8")

        def filled(words: list[str]) -> list[str]:
            return [word.format(root=root, build=build) for word in words]

        def tests(**more: list[str]) -> list[Test]:
            return described([
                {"name": name, "command": filled(command + more.get(name, [])),
                 "properties": [{"name": "ENVIRONMENT", "value": filled(ENVIRONMENT.get(name, []))},
                                {"name": "COST", "value": len(more)}]}
                for name, command in TESTS.items()], build, root)

        def write_results(names: list[str], failing: str, skipped: str = "") -> None:
            status = {failing: "fail", skipped: "notrun"}
            cases = "".join(f'<testcase name="{name}" status="{status.get(name, "run")}"/>' for name in names)
            (build / "tests.xml").write_text(f"<testsuite>{cases}</testsuite>", encoding="utf-8")

        def run(failing: str = "", skipped: str = "", **more: list[str]) -> set[str]:
            """Selects, runs unless that is interrupted, and records."""
            names = select(tests(**more), build)
            if failing != "interrupted":
                write_results(names, failing, skipped)
            record(build)
            return set(names)

        expect("at first", run("interrupted"), ALL)
        expect("after an interruption", run(), ALL)
        expect("unchanged", run(), set())
        for name, affected in CHANGES.items():
            with open(root / name, "a", encoding="utf-8") as changed:
                changed.write("# changed\n")
            expect(f"{name} changed", run(), affected)
            (root / name).touch()
            expect(f"{name} touched", run(), set())
        (root / "docs/new.md").unlink()
        expect("a file removed", run(), {"rules", "consumers"})
        (build / "apps/tool").unlink()
        expect("a program removed", run(), {"top", "latency", "consumers"})
        expect("another argument", run(own=["--again"]), {"own"})
        expect("the argument removed", run(), {"own"})

        (root / "test/cli/top_test.py").write_text("", encoding="utf-8")
        expect("a change with which a test fails", run(failing="top"), {"top", "rules"})
        expect("after the failure", run(skipped="top"), {"top"})
        expect("after it was skipped", run(), {"top"})
        expect("after it passed", run(), set())
        (root / "test/cli/top_test.py").write_text(SOURCES["test/cli/top_test.py"] + "pass\n", encoding="utf-8")
        write_results(list(TESTS), failing="")
        expect("interrupted", run("interrupted"), {"top", "rules"})
        expect("after that", run(), {"top", "rules"})

        write_results(list(TESTS), failing="own")
        record(build, were_selected=False)
        expect("after a failure in a run of all tests", run("interrupted"), {"own"})
        write_results(list(TESTS), failing="")
        record(build, were_selected=False)
        expect("after they passed in a run of all tests", run(), {"own"})

        by_name = {test.name: test for test in tests()}
        expect("targets of own", targets([by_name["own"]], build), ["test/own"])
        expect("targets of two", targets([by_name["own"], by_name["top"]], build), ["apps/tool", "test/own"])
        expect("targets of latency", targets([by_name["latency"]], build),
               ["apps/loaded.so", "apps/tool", "perf/with space:colon"])
        expect("targets of consumers", targets([by_name["consumers"]], build), ["all"])
        expect("targets of what ctest does not find", targets(described([{"name": "new"}], build, root), build), ["all"])
        expect("targets of rules", targets([by_name["rules"]], build), [])
        (build / STATE).write_text("{", encoding="utf-8")
        expect("without what was remembered", run(), ALL)

    expect("a pattern", pattern_of(["a.b", "c"]), r"^(a\.b|c)$")
    expect("no pattern", pattern_of([]), "")
    print("\n".join([*mistakes, f"affected tests, self-test: {len(mistakes)} mistakes"]))
    return 1 if mistakes else 0


def main(arguments: list[str]) -> int:
    if arguments == ["--self-test"]:
        return self_test()
    if len(arguments) < 2 or arguments[0] not in ("targets", "select", "record", "forget"):
        print(__doc__, file=sys.stderr)
        return 2
    command, build, rest = arguments[0], Path(arguments[1]).resolve(), arguments[2:]
    if command in ("record", "forget"):
        record(build, were_selected=command == "record")
        return 0
    if command == "targets":
        # What is built may itself have changed.
        subprocess.run(["cmake", "--build", str(build), "--target", "build.ninja"], stdout=subprocess.DEVNULL, check=False)
    tests = tests_of(build, rest, ROOT)
    if not tests:
        print("cles: no test matches", file=sys.stderr)
        return 1
    if command == "targets":
        print("\n".join(targets(tests, build)))
    else:
        names = select(tests, build)
        print(f"cles: {len(names)} of {len(tests)} tests are affected", file=sys.stderr)
        print(pattern_of(names))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
