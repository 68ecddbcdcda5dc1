#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The minimal service is suitable for small devices: its size, the libraries it links, its memory while it serves. perf/README.md
states its size and what is allowed.

    minimal_service.py STRIPPED_PROGRAM
"""

import json
import os
import re
import socket
import subprocess
import sys
from pathlib import Path
from statistics import median

MAX_SIZE = 1_080_000  # what it has reached, and one page: looking up names side by side, trying several addresses, asking a
# silent node whether it lives, following the interfaces of the host, asking for others, and delivering updates in batches are in it
MAX_PRIVATE = 1 << 20
MAX_RESIDENT = 4 << 20
MAX_OFF = 8_192  # bytes by which the size on the page may differ
REQUESTS = 2_000
# Those of the system: the C and C++ libraries, the loader, and what the kernel maps.
ALLOWED = re.compile(r"^(libc|libm|libstdc\+\+|libgcc_s)\.so\.|^ld-linux.*\.so\.|^linux-(vdso|gate)\.so\.")

failures = []


def expect(good: bool, what: str) -> None:
    print(("  ok    " if good else "  FAIL  ") + what)
    if not good:
        failures.append(what)


def linked_libraries(program: str) -> list[str]:
    listed = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    return sorted(Path(line.split()[0]).name for line in listed.splitlines() if line.strip())


def memory_of(process: int) -> dict[str, int]:
    """{name in smaps: bytes}"""
    text = Path(f"/proc/{process}/smaps_rollup").read_text(encoding="ascii")
    return {name: int(kib) * 1024 for name, kib in re.findall(r"^(\w+):\s+(\d+) kB", text, re.MULTILINE)}


def ask(endpoint: str) -> None:
    host, port = re.fullmatch(r"tcp://([\d.]+):(\d+)", endpoint).groups()
    with socket.create_connection((host, int(port)), timeout=10) as link, link.makefile("r", encoding="utf-8") as lines:
        for number in range(1, REQUESTS + 1):
            link.sendall(f"PULL car1:position id={number} deadline=5000\n".encode())
            reply = lines.readline()
            assert json.loads(reply.removeprefix(f"id={number} "))["lat"] == 48.137154, reply


def memory_while_serving(program: str) -> dict[str, int]:
    with subprocess.Popen([program, "tcp://127.0.0.1:0"], stdout=subprocess.PIPE, text=True) as service:
        try:
            endpoint = service.stdout.readline().strip()
            ask(endpoint)
            return memory_of(service.pid)
        finally:
            service.kill()


def check_page(size: int) -> None:
    page = (Path(__file__).resolve().parents[2] / "perf" / "README.md").read_text(encoding="utf-8")
    stated = re.search(r"^\| minimal service .*? \| ([\d,]+) bytes \|", page, re.MULTILINE)
    allowed = re.search(r"^\| the minimal service \| .*? \| \u2264 ([\d.]+) MB", page, re.MULTILINE)
    if not stated or not allowed:
        expect(False, "perf/README.md states the size, and what is allowed")
        return
    of_page = int(stated[1].replace(",", ""))
    expect(abs(size - of_page) <= MAX_OFF, f"perf/README.md states {of_page} bytes, at most {MAX_OFF} off")
    expect(round(float(allowed[1]) * 1e6) == MAX_SIZE, f"perf/README.md states that {allowed[1]} MB are allowed")


def main(program: str) -> int:
    size = Path(program).stat().st_size
    expect(size <= MAX_SIZE, f"size {size} bytes, allowed {MAX_SIZE}")
    check_page(size)

    libraries = linked_libraries(program)
    foreign = [name for name in libraries if not ALLOWED.search(name)]
    expect(not foreign, f"links {' '.join(libraries)}" + (f": foreign are {' '.join(foreign)}" if foreign else ""))

    # A file that was just linked counts as written until it is on the disk.
    with open(program, "rb") as file:
        os.fsync(file.fileno())

    # Private is what the process has written and no other can share. Its clean pages are the page cache's copy of the
    # program's file, which all who run it share and the kernel may take back; how many it maps differs from run to run.
    samples = [memory_while_serving(program) for _ in range(5)]
    private = median(each["Private_Dirty"] for each in samples)
    resident = median(each["Rss"] for each in samples)
    detail = f"and {median(each['Private_Clean'] for each in samples) // 1024} KiB of its file mapped by it alone"
    expect(private <= MAX_PRIVATE, f"private memory {private // 1024} KiB ({detail}), allowed {MAX_PRIVATE // 1024} KiB")
    expect(resident <= MAX_RESIDENT, f"resident memory {resident // 1024} KiB, allowed {MAX_RESIDENT // 1024} KiB")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
