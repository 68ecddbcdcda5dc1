#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Private keys are never in the arguments, environment, log or core dumps of a daemon, and their memory is locked."""

import base64
import contextlib
import hashlib
import json
import os
import pwd
import re
import resource
import shutil
import signal
import subprocess
import sys
import unittest

from daemon import CLESD, clesd
from secured import Fleet, Node, cles
from support import CLES, PATIENCE, finish, wait_until

IS_ROOT = os.geteuid() == 0
READS_MEMORY = "import sys\nopen(f'/proc/{sys.argv[1]}/mem', 'rb').close()\n"


def seed_of(fleet, name):
    """The private key, as text and as bytes."""
    with open(os.path.join(fleet.keys(name), "key"), encoding="utf-8") as file:
        text = json.load(file)["seed"]
    return text, base64.urlsafe_b64decode(text + "=")


def scalar_of(seed):
    """What Ed25519 and X25519 compute with (RFC 8032, 5.1.5)."""
    digest = bytearray(hashlib.sha512(seed).digest()[:32])
    digest[0] &= 248
    digest[31] = digest[31] & 127 | 64
    return bytes(digest)


def mappings_of(pid):
    """(begin, end, flags) of each readable mapping, with the flags of /proc/PID/smaps."""
    found = []
    with open(f"/proc/{pid}/smaps", encoding="utf-8") as smaps:
        for line in smaps:
            if head := re.match(r"([0-9a-f]+)-([0-9a-f]+) r", line):
                found.append([int(head[1], 16), int(head[2], 16), set()])
            elif re.match(r"[0-9a-f]+-[0-9a-f]+ ", line):
                found.append([0, 0, set()])
            elif line.startswith("VmFlags:"):
                found[-1][2] = set(line.split()[1:])
    return [each for each in found if each[1] != 0]


def places_of(pid, wanted):
    """The flags of the mappings that contain these bytes."""
    places = []
    too_large = 1 << 30  # those in which sanitizers keep their own records
    with open(f"/proc/{pid}/mem", "rb", buffering=0) as memory:
        for begin, end, flags in mappings_of(pid):
            with contextlib.suppress(OSError, OverflowError):  # those of the kernel
                memory.seek(begin)
                if end - begin < too_large and wanted in memory.read(end - begin):
                    places.append(flags)
    return places


class Secrets(unittest.TestCase):
    def setUp(self):
        self.fleet = Fleet("car1", "operator")
        self.addCleanup(self.fleet.__exit__)

    def start(self, name="car1", **how):
        node = Node(self.fleet, name, level="debug", **how)
        self.addCleanup(node.__exit__)
        return node

    def node_in_use(self):
        node = self.start()
        self.assertEqual(cles("pull", "car1:cles", "-k", self.fleet.keys("operator"), "--at", node.url)[0], 0)
        node.process.send_signal(signal.SIGHUP)
        wait_until(lambda: any("reloaded" in each for each in node.messages()), "it reloads")
        return node

    def test_no_output_contains_a_key(self):
        node = self.node_in_use()
        text, seed = seed_of(self.fleet, "car1")
        outputs = [json.dumps(node.messages()), *clesd("--keys", self.fleet.keys("car1"), "--print-config")[1:],
                   *clesd("--keys", self.fleet.keys("car1"), "--check")[1:]]
        for task in ("cles", "cles/metrics", "cles/peers", "cles/roster"):
            outputs.append(node.ask(f"PULL self:{task}"))
        for file in ["cmdline", "environ"] if IS_ROOT else ["cmdline"]:  # others cannot read that of such a process
            with open(f"/proc/{node.process.pid}/{file}", encoding="utf-8") as read:
                outputs.append(read.read())
        for form in (text, seed.hex(), base64.b64encode(seed).decode().rstrip("=")):
            for output in outputs:
                self.assertNotIn(form, output)

    def test_a_key_is_not_an_argument(self):
        text, _ = seed_of(self.fleet, "car1")
        for command in ([CLESD, "--check", "--keys", text], [CLES, "pull", "self:cles", "--keys", text]):
            done = subprocess.run(command, capture_output=True, text=True, cwd=self.fleet.path, timeout=PATIENCE, check=False)
            self.assertNotEqual(done.returncode, 0)  # it is the name of a directory

    @unittest.skipUnless(IS_ROOT, "only root can read the memory of such a process")
    def test_keys_are_in_locked_memory_that_is_not_dumped(self):
        node = self.node_in_use()
        text, seed = seed_of(self.fleet, "car1")
        with open(f"/proc/{node.process.pid}/maps", encoding="utf-8") as maps:
            sanitized = re.search(r"lib[at]san", maps.read())  # it does not lock memory
        self.assertTrue(places_of(node.process.pid, seed), "the search finds nothing at all")
        for form in (seed, scalar_of(seed), text.encode()):
            for flags in places_of(node.process.pid, form):
                self.assertIn("dd", flags)
                if not sanitized:
                    self.assertIn("lo", flags)

    def crash(self, process):
        """Whether it left a core dump. Sanitizers do not handle this signal."""
        process.send_signal(signal.SIGQUIT)
        _, status = os.waitpid(process.pid, 0)
        process.returncode = -signal.SIGQUIT
        process.stdout.close()
        self.assertTrue(os.WIFSIGNALED(status), status)
        return os.WCOREDUMP(status)

    def test_there_are_no_core_dumps(self):
        """Unlike of other programs, where the system permits them."""
        def unlimited():
            hard = resource.getrlimit(resource.RLIMIT_CORE)[1]
            resource.setrlimit(resource.RLIMIT_CORE, (hard, hard))

        here = {"cwd": self.fleet.path, "preexec_fn": unlimited}
        node = Node(self.fleet, "car1", **here)
        with open(f"/proc/{node.process.pid}/limits", encoding="utf-8") as limits:
            core = next(line for line in limits if line.startswith("Max core file size"))
        self.assertEqual(core.split()[4], "0")
        self.assertFalse(self.crash(node.process))
        serving = subprocess.Popen([CLES, "serve", "-k", self.fleet.keys("car1"), "--listen", "tls://127.0.0.1:0"],
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, **here)
        self.assertIn(b"listening", serving.stdout.readline())
        self.assertFalse(self.crash(serving))
        other = subprocess.Popen([sys.executable, "-c", "print('up', flush=True)\nimport time\ntime.sleep(60)"],
                                 stdout=subprocess.PIPE, **here)
        other.stdout.readline()
        print("another program leaves a core dump:", self.crash(other))

    def test_the_user_cannot_read_the_memory(self):
        as_user = {}
        program = CLESD
        if IS_ROOT:  # who may read all; so the daemon and the reader run as another user
            nobody = pwd.getpwnam("nobody")
            as_user = {"user": nobody.pw_uid, "group": nobody.pw_gid, "extra_groups": []}
            program = shutil.copy(CLESD, self.fleet.file("clesd"))
            for folder, _, files in os.walk(self.fleet.path):
                for each in (folder, *(os.path.join(folder, file) for file in files)):
                    os.chown(each, nobody.pw_uid, nobody.pw_gid)
        node = self.start(program=program, **as_user)

        def read(pid):
            return subprocess.run(["python3", "-c", READS_MEMORY, str(pid)], cwd="/", capture_output=True, text=True,
                                  timeout=PATIENCE, check=False, **as_user).stderr

        self.assertIn("Permission denied", read(node.process.pid))
        other = subprocess.Popen(["sleep", "60"], cwd="/", **as_user)
        try:
            self.assertEqual(read(other.pid), "")  # that of other programs it can
        finally:
            other.kill()
            finish(other)


if __name__ == "__main__":
    unittest.main()
