# SPDX-License-Identifier: BSL-1.0
"""Builds the programs that are measured, if they are not up to date."""

import fnmatch
import os
import subprocess

BUILD = "build/release"


class Failed(Exception):
    pass


def build(targets, say):
    """Installs missing packages, configures the build if needed, and builds the targets that exist. Runs in the project's
    root folder."""
    os.makedirs(BUILD, exist_ok=True)
    log = os.path.join(BUILD, "evaluate.log")
    _run(["scripts/setup", "--evaluate"], log)
    stale = os.path.join(BUILD, "configure.log")
    if (not os.path.exists(f"{BUILD}/build.ninja") or not os.path.exists(stale)
            or os.path.getmtime("CMakePresets.json") > os.path.getmtime(stale)):
        say("configuring")
        _run(["cmake", "--preset", "release"], stale)
    offered = {line.split(":")[0].strip() for line in _run(["cmake", "--build", BUILD, "--target", "help"], log).splitlines()}
    wanted = sorted({name for target in targets for name in fnmatch.filter(offered, target) if "/" not in name
                     and not name.endswith(("_autogen", ".a", ".so"))})
    if wanted:
        say("building " + ", ".join(wanted) + " (the first time takes some minutes)")
        _run(["cmake", "--build", "--preset", "release", "--target", *wanted], log)


def _run(command, log):
    """Returns the output, which is also in the log."""
    environment = {"CMAKE_BUILD_PARALLEL_LEVEL": str(os.cpu_count() or 1), **os.environ}
    with open(log, "w+", encoding="utf-8", errors="replace") as out:
        try:
            code = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, check=False,
                                  env=environment).returncode
        except OSError as failure:
            raise Failed(f"{command[0]}: {failure.strerror}") from failure
        out.seek(0)
        printed = out.read()
    if code != 0:
        raise Failed(f"{' '.join(command)} ended with {code} ({log}):\n" + "\n".join(printed.splitlines()[-25:]))
    return printed


def compiler(build_folder):
    """As "g++ (Debian 12.2.0-14) 12.2.0, -O2 -DNDEBUG"; unknown parts are left out."""
    cache = {}
    try:
        with open(os.path.join(build_folder, "CMakeCache.txt"), encoding="utf-8") as file:
            for line in file:
                key, separator, value = line.rstrip("\n").partition("=")
                if separator and not key.startswith(("#", "//")):
                    cache[key.partition(":")[0]] = value
    except OSError:
        return ""
    kind = cache.get("CMAKE_BUILD_TYPE", "")
    program = cache.get("CMAKE_CXX_COMPILER", "")
    try:
        first = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    except (OSError, subprocess.CalledProcessError, IndexError):
        first = os.path.basename(program)
    flags = " ".join(filter(None, [cache.get("CMAKE_CXX_FLAGS", ""), cache.get(f"CMAKE_CXX_FLAGS_{kind.upper()}", "")]))
    return ", ".join(filter(None, [first, kind, flags]))


def commit():
    """The commit that was measured, as git describes it; empty without git."""
    try:
        return subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True,
                              check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
