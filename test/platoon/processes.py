# SPDX-License-Identifier: BSL-1.0
"""What the tests of a platoon as processes share: running `cles-platoon`, and drives of several vehicles."""

import json
import os
import re
import subprocess
import time
import unittest

from support import free_port
from two_hosts import cannot_be_made

PLATOON = os.environ["PLATOON"]
PATIENCE = float(os.environ.get("CLES_TEST_PATIENCE", "60"))


def environment():
    return {name: value for name, value in os.environ.items() if not name.startswith(("CLES_M", "CLES_K"))}


def free_group():
    return f"lo,239.255.25.37:{free_port()}"


def start(*arguments, stdout=subprocess.PIPE, **more):
    return subprocess.Popen([PLATOON, *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=stdout,
                            stderr=subprocess.PIPE, text=True, env=environment(), **more)


def run(*arguments):
    """Exit code, stdout, stderr."""
    process = start(*arguments)
    try:
        out, err = process.communicate(timeout=PATIENCE)
    finally:
        ended(process)
    return process.returncode, out, err


def ended(process):
    """Ensures that no process is left."""
    process.kill()
    process.wait()
    for pipe in (process.stdout, process.stderr):
        if pipe:
            pipe.close()


def children_of(pid):
    with open(f"/proc/{pid}/task/{pid}/children", encoding="ascii") as children:
        return [int(child) for child in children.read().split()]


def is_running(pid):
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until(condition, what):
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError(f"waited in vain: {what}")


def read_until(process, expression):
    """The first of the next lines that contains it."""
    for line in process.stdout:
        if re.search(expression, line):
            return line
    raise AssertionError(f"it has ended: {process.stderr.read()}")


class DriveTest(unittest.TestCase):
    def drive(self, *arguments, group=None):
        """The object that it prints. The exit code is 4 if the drive was too short for the manoeuvre."""
        ended, out, err = run("run", "--multicast", group or free_group(), "--json", *arguments)
        if ended == 3 and "faults need a network namespace" in err:
            cannot_be_made(err.strip())
        self.assertIn(ended, (0, 4), err + out[:2000])
        found = json.loads(out)
        self.assertEqual(ended, 4 if found["steady"] and not found["verdict"]["ended"] else 0)
        self.assertFalse(found["verdict"]["collision"], found["events"])
        return found

    def modes(self, found, vehicle):
        return [event["mode"] for event in found["events"] if event["vehicle"] == vehicle]

    def speed(self, found, vehicle):
        """At the end; None: it is not on the lane."""
        return next(course for course in found["courses"] if course["vehicle"] == vehicle)["speed"][-1]
