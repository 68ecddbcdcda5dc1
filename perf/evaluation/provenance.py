# SPDX-License-Identifier: BSL-1.0
"""The origin of figures: the machine, the date, and the command that repeats them."""

import datetime
import os
import platform
import re
import shlex
import sys
import time


def machine():
    return {"system": platform.platform(), "processor": processor(), "cores": os.cpu_count(),
            "usable_cores": len(os.sched_getaffinity(0)), "kernel": platform.release(), "memory_mib": memory_mib(),
            "busy_cores": busy_cores()}


def busy_cores(seconds=1.0):
    """How many cores other processes keep busy in this period before anything is measured. (The load average would include
    earlier measurements.) None if the system does not report it."""
    before = _ticks()
    time.sleep(seconds)
    after = _ticks()
    if not before or not after or sum(after) == sum(before):
        return None
    idle = sum(after[3:5]) - sum(before[3:5])  # and waiting for I/O
    return round((1 - idle / (sum(after) - sum(before))) * (os.cpu_count() or 1), 2)


def _ticks():
    """The times of all cores together: user, nice, system, idle, iowait, irq, softirq, steal."""
    found = re.match(r"cpu +(.+)", text_of("/proc/stat"))
    return [int(each) for each in found[1].split()[:8]] if found else []


def processor():
    found = re.search(r"model name\s*:\s*(.+)", text_of("/proc/cpuinfo"))
    return found[1] if found else platform.machine()


def memory_mib():
    found = re.search(r"MemTotal:\s*(\d+) kB", text_of("/proc/meminfo"))
    return int(found[1]) // 1024 if found else None


def text_of(path):
    try:
        with open(path, encoding="utf-8") as file:
            return file.read()
    except OSError:
        return ""


def date():
    return datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")


def command(script, arguments=None):
    """The command, as typed in the project's root folder."""
    return shlex.join([script, *(sys.argv[1:] if arguments is None else arguments)])
