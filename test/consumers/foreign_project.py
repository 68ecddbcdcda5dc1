# SPDX-License-Identifier: BSL-1.0
"""Another project, built against CLES from outside of its tree."""

import argparse
import os
import shutil
import subprocess
from pathlib import Path


def expect(holds: bool, what: str) -> None:
    if not holds:
        raise AssertionError(what)


class ForeignProject:
    """Uses a folder that is emptied first."""

    def __init__(self, options: argparse.Namespace):
        self.options = options
        self.scratch: Path = options.scratch
        shutil.rmtree(self.scratch, ignore_errors=True)
        self.scratch.mkdir(parents=True)
        # Without the caller's settings; the results of earlier runs in ccache are used, including precompiled headers.
        self.environment = {k: v for k, v in os.environ.items() if not k.startswith(("CMAKE_", "PKG_CONFIG"))}
        self.environment |= {"CCACHE_SLOPPINESS": "pch_defines,time_macros", "CCACHE_BASEDIR": str(options.source),
                             "CCACHE_NOHASHDIR": "1"}

    def run(self, *command: object, fails: bool = False, environment: dict[str, str] | None = None) -> str:
        words = [str(word) for word in command]
        print("$", " ".join(words), flush=True)
        done = subprocess.run(words, cwd=self.scratch, env=self.environment | (environment or {}),
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        expect((done.returncode != 0) == fails, f"ended with {done.returncode}:\n{done.stdout}")
        return done.stdout

    def install(self) -> Path:
        """Installs to a fresh prefix and moves that: a package may be packed here and unpacked elsewhere, and nothing of
        the tree that it comes from may be needed."""
        first, prefix = self.scratch / "first", self.scratch / "prefix"
        self.run(self.options.cmake, "--install", self.options.build, "--prefix", first)
        first.rename(prefix)
        return prefix
