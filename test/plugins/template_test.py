#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Makes a plugin as someone else does: from a copy of the template, against an installed CLES, with another compiler.

    template_test.py --cmake CMAKE --compiler CXX --c-compiler CC --source ROOT --build BUILD --scratch FOLDER --probe PROGRAM

FOLDER is emptied first. PROGRAM loads a plugin as the daemon does.
"""

import argparse
import shutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "consumers"))
from foreign_project import ForeignProject, expect  # noqa: E402


class Maker(ForeignProject):
    def make(self, prefix: Path) -> Path:
        copy = self.scratch / "mine"
        shutil.copytree(prefix / "share" / "doc" / "cles" / "plugins" / "template", copy)
        expect((copy / "README.md").is_file(), "the template comes without its page")
        build = self.scratch / "build"
        launcher = shutil.which("ccache")
        more = [f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}"] if launcher else []
        self.run(self.options.cmake, "-G", "Ninja", "-S", copy, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}",
                 f"-DCMAKE_CXX_COMPILER={self.options.compiler}", "-DCMAKE_BUILD_TYPE=Release", *more)
        self.run(self.options.cmake, "--build", build)
        return build / "my_plugin.so"

    def check(self, plugin: Path) -> None:
        shown = self.run("nm", "--dynamic", "--defined-only", plugin).split()
        expect(shown[-1] == "cles_plugin_v1" and len(shown) == 3, f"it shows more than its entry: {shown}")
        commands = ["PULL self:hello/you", 'DELEGATE self:minutes {"km":30,"kmh":60}', "PUSH self:notice {}"]
        printed = self.run(self.options.probe, plugin, '{"greeting":"Good day"}', *commands)
        expect(printed == 'my_plugin 1.0\n{"value":"Good day, you!"}\n{"value":30}\n{}\n', f"it answers {printed!r}")
        refused = self.run(self.options.probe, plugin, "{}", 'DELEGATE self:minutes {"km":30,"kmh":0}', fails=True)
        expect("bad_request: node: kmh must be more than 0" in refused, f"across the compilers an error becomes {refused!r}")
        slip = self.run(self.options.probe, plugin, '{"greting":"Hi"}', fails=True)
        expect(slip == f"{plugin}: it has no setting 'greting'\n", f"a wrong setting is told as {slip!r}")

    def check_c(self, prefix: Path) -> None:
        """The ABI is plain C, whatever the compiler."""
        header = prefix / "include" / "cles" / "plugin_abi.h"
        self.run(self.options.c_compiler, "-x", "c", "-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror",
                 "-fsyntax-only", header)


def main() -> int:
    parser = argparse.ArgumentParser()
    for name in ("cmake", "compiler", "c-compiler"):
        parser.add_argument(f"--{name}", required=True)
    for name in ("source", "build", "scratch", "probe"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    maker = Maker(parser.parse_args())
    try:
        prefix = maker.install()
        maker.check_c(prefix)
        maker.check(maker.make(prefix))
    except AssertionError as failure:
        print(failure)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
