# SPDX-License-Identifier: BSL-1.0
"""How the sources of a build are compiled."""

import json
import os
import shlex
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Compilation:
    source: Path
    options: tuple[str, ...]  # all but compiler, output, dependencies and source

    @property
    def definitions(self) -> set[str]:
        """Without those of Boost that only Visual C++ reads, which tell it what to link."""
        return {option[2:] for option in self.options if option.startswith("-D") and not option.endswith("_NO_LIB")}

    @property
    def folders(self) -> set[str]:
        """Where headers are looked for."""
        options = iter(self.options)
        found = set()
        for option in options:
            if option == "-isystem":
                found.add(os.path.realpath(next(options)))
            elif option.startswith("-I"):
                found.add(os.path.realpath(option[2:]))
        return found


def compilations_in(database: str) -> dict[str, Compilation]:
    """{object file, relative to the build: how it is compiled}, of what CMake exports or `ninja -t compdb` prints."""
    found = {}
    for entry in json.loads(database):
        words = shlex.split(entry["command"])
        if "-c" not in words:
            continue
        source, output = words[words.index("-c") + 1], words[words.index("-o") + 1]
        left_out = {*range(next(at for at, word in enumerate(words) if word.startswith("-")))}  # the compiler, and ccache
        for at, word in enumerate(words):
            if word in ("-c", "-o", "-MF", "-MT"):
                left_out |= {at, at + 1}
            elif word == "-MD":
                left_out.add(at)
        found[output] = Compilation(Path(entry["directory"], source),
                                    tuple(word for at, word in enumerate(words) if at not in left_out))
    return found
