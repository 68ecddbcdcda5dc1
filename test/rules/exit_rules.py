#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Checks that the library has no static object whose destructor runs at exit: a service in a static object would use it after
that. Such an object is made with `new` and never deleted.

    exit_rules.py ARCHIVE...     reads what was compiled; prints each such object; exits 1 where there is one
    exit_rules.py --self-test    plants some in what objdump prints and expects to find every one of them
"""

import re
import subprocess
import sys

# Each function has a section of its own (cmake/target_defaults.cmake).
FUNCTION = re.compile(r"^RELOCATION RECORDS FOR \[\.text(?:\.(?:startup|unlikely|hot|exit))?\.(?P<name>[^\]]+)\]:$")
OTHER_SECTION = "RELOCATION RECORDS FOR"
RELOCATION = re.compile(r"^[0-9a-f]+ R_\w+\s+(?P<symbol>[^\s+-]+)")
REGISTERS = ("__cxa_atexit", "__cxa_thread_atexit", "atexit")
# In the name of a section, or of the object itself: an object of ours, in a namespace or in a function.
OURS = re.compile(r"^(?:\.t?(?:bss|data)[\w.]*\._Z(?:N|ZNK?)4cles\w+|_ZZNK?4cles\w+|_ZN4cles\w+E)$")
# How many symbols before a registration may be its object: its other arguments, and what the constructor needs, come after.
# What the function made before, such as an object by `new`, is farther away.
NEAR = 5
FUNCTION_OF_OURS = re.compile(r"^_Z(?:ZNK?|NK?)4cles")


def plain(symbol: str) -> str:
    name = re.search(r"_Z\w+", symbol)
    done = subprocess.run(["c++filt", name[0] if name else symbol], capture_output=True, text=True, check=False)
    return done.stdout.strip() or symbol


def destroyed_at_exit(relocations: str) -> list[str]:
    """The objects of ours for which the code registers a destructor, or the function that does."""
    found, function, since = [], "", []
    for line in relocations.splitlines():
        if line.startswith(OTHER_SECTION):
            match = FUNCTION.match(line)
            function, since = match["name"] if match else "", []
        elif match := RELOCATION.match(line):
            symbol = match["symbol"]
            if symbol not in REGISTERS:
                since.append(symbol)
                continue
            of_ours = FUNCTION_OF_OURS.match(function)
            objects = [each for each in since[-NEAR:] if OURS.match(each) and ("_ZZ" in each or not of_ours)]
            if objects or of_ours:
                found.append(objects[-1] if objects else function)
            since = []
    return found


def check(archives: list[str]) -> int:
    found = []
    for archive in archives:
        shown = subprocess.run(["objdump", "--reloc", archive], capture_output=True, text=True, check=True).stdout
        found += [f"{archive}: {plain(each)}: destroyed at exit; make it with new" for each in destroyed_at_exit(shown)]
    print("\n".join([*found, f"exit rules: {len(archives)} archives, {len(found)} violations"]))
    return 1 if found else 0


# What objdump prints, shortened.
def code(function: str, *symbols: str) -> str:
    lines = [f"\nRELOCATION RECORDS FOR [.text.{function}]:", "OFFSET           TYPE              VALUE"]
    lines += [f"{7 * at:016x} R_X86_64_PC32     {symbol}-0x{4:016x}" for at, symbol in enumerate(symbols)]
    return "\n".join(lines) + "\n"


GOOD = (
    code("startup._GLOBAL__sub_I_a.cpp", "__dso_handle", "_ZN5boost4asio6detail12service_baseINS1_14strand_serviceEE2idE",
         "_ZN5boost4asio6detail10service_idINS1_14strand_serviceEED1Ev", "__cxa_atexit")
    + code("startup._GLOBAL__sub_I_b.cpp", "_Znwm", ".bss._ZN4cles12_GLOBAL__N_15namesE", *2 * (".bss._ZGVN5boost4asio2idE",),
           "_ZN5boost4asio2idE", "_ZN5boost4asio8service_idD1Ev", "__dso_handle", "__cxa_atexit")
    + code("_ZN4cles4stopEv", ".bss._ZN4cles12_GLOBAL__N_15countE", "_ZN4cles4other")
)
PLANTED = {
    "_ZN4cles12_GLOBAL__N_16nobodyE": code("startup._GLOBAL__sub_I_a.cpp", "__dso_handle", ".bss._ZN4cles12_GLOBAL__N_16nobodyE",
                                           "_ZNSt6vectorIiED1Ev", "__cxa_atexit"),
    "_ZZN4cles4noneEvE6object": code("_ZN4cles4noneEv", ".bss._ZGVZN4cles4noneEvE6object", ".bss._ZZN4cles4noneEvE6object",
                                     "__dso_handle", "__cxa_atexit"),
    "_ZZN4cles4seedEvE4draw": code("_ZN4cles4seedEv", ".tbss._ZZN4cles4seedEvE4draw", "__dso_handle", "__cxa_thread_atexit"),
    "_ZN4cles12_GLOBAL__N_15tableE": code("startup._GLOBAL__sub_I_c.cpp", ".bss._ZN4cles12_GLOBAL__N_15tableE", ".rodata.str1.1",
                                          "_ZNSt6vectorIiEC1Ev", "__dso_handle", "_ZNSt6vectorIiED1Ev", "__cxa_atexit"),
    "_ZN4cles5otherEv": code("_ZN4cles5otherEv", "__dso_handle", "__cxa_atexit"),
}


def self_test() -> int:
    mistakes = [f"found in code that keeps the rule: {each}" for each in destroyed_at_exit(GOOD)]
    for name, text in PLANTED.items():
        found = destroyed_at_exit(GOOD + text + GOOD)
        if len(found) != 1 or not found[0].endswith(name):
            mistakes.append(f"{name}: found {found}")
    print("\n".join([*mistakes, f"exit rules, self-test: {len(PLANTED)} violations planted, {len(mistakes)} mistakes"]))
    return 1 if mistakes else 0


if __name__ == "__main__":
    sys.exit(self_test() if sys.argv[1:] == ["--self-test"] else check(sys.argv[1:]))
