#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Output that nobody reads, or that does not fit: the daemon goes on without its log, and what it was started to print
is not lost silently."""

import fcntl
import os
import signal
import subprocess
import time
import unittest

from daemon import CLESD, DEFAULTS, STUBBORN, Folder, Link, clean_environment
from support import CLES, PATIENCE, environment, finish, on_terminal, read_line

PIPE_SIZE = 1031  # F_SETPIPE_SZ


def full_pipe():
    """A pipe that takes nothing more: the end to read, the end to write."""
    read, write = os.pipe()
    fcntl.fcntl(write, PIPE_SIZE, 4096)
    os.write(write, b"." * 4095 + b"\n")
    return read, write


class Unread(unittest.TestCase):
    def setUp(self):
        self.read, self.write = full_pipe()
        self.addCleanup(os.close, self.read)
        self.folder = Folder()
        self.addCleanup(self.folder.__exit__)

    def start(self, *command, env):
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self.write,
                                   text=True, env=env)
        os.close(self.write)
        self.addCleanup(process.kill)
        line = read_line(process)
        self.assertIn(" listening on tcp://127.0.0.1:", line)
        return process, int(line.rpartition(":")[2])

    def daemon(self, more=""):
        return self.start(CLESD, "--config", self.folder.write(DEFAULTS + more), env=clean_environment())

    def ends(self, process):
        begun = time.monotonic()
        process.send_signal(signal.SIGTERM)
        code, _, _ = finish(process)
        self.assertEqual(code, 0)
        self.assertLess(time.monotonic() - begun, 5 * PATIENCE / 30)

    def serves(self, port, name):
        with Link(port) as link:
            self.assertIn(f'"node":"{name}"', link.ask("PULL self:cles"))

    def test_a_daemon_whose_log_nobody_reads_serves_and_stops(self):
        process, port = self.daemon()
        for _ in range(3):
            process.send_signal(signal.SIGHUP)  # it logs that it has read its configuration
            self.serves(port, "sat1")
        self.ends(process)

    def test_a_second_signal_stops_it_at_once(self):
        process, port = self.daemon()
        self.serves(port, "sat1")
        process.send_signal(signal.SIGTERM)
        self.ends(process)

    def test_cles_serve_goes_on_too(self):
        process, port = self.start(CLES, "serve", "-vv", "--listen", "tcp://127.0.0.1:0", env=environment())
        for _ in range(100):
            self.serves(port, "car1")
        self.ends(process)

    def test_the_lines_come_when_they_are_read(self):
        process, port = self.daemon()
        self.serves(port, "sat1")
        process.send_signal(signal.SIGTERM)
        with os.fdopen(os.dup(self.read), encoding="utf-8") as log:
            lines = log.read().splitlines()
        self.assertEqual(finish(process)[0], 0)
        self.assertTrue(any("stopping on SIGTERM" in line for line in lines), lines)
        self.assertIn('"message":"stopped"', lines[-1])

    def test_the_last_lines_come_if_an_exception_ends_the_process(self):
        process, port = self.daemon(f"plugins: [{STUBBORN}]\n")
        for _ in range(100):
            process.send_signal(signal.SIGHUP)  # more than the pipe takes at once
            self.serves(port, "sat1")
        with Link(port) as link, os.fdopen(os.dup(self.read), encoding="utf-8") as log:
            link.send("DELEGATE sat1:throws_elsewhere id=1")
            text = log.read()
        self.assertEqual(finish(process)[0], -signal.SIGABRT)
        self.assertGreater(text.count("reloaded the configuration"), 80)  # two signals may count as one


class Full(unittest.TestCase):
    def refused(self, *command, env):
        with open("/dev/full", "w", encoding="utf-8") as full:
            done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=full, stderr=subprocess.PIPE, text=True,
                                  env=env, timeout=PATIENCE, check=False)
        self.assertEqual(done.returncode, 1, command)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        self.assertIn("cannot write the output", done.stderr)

    def test_what_is_printed_has_to_fit(self):
        with Folder() as folder:
            config = folder.write(DEFAULTS)
            for arguments in (["--version"], ["--help"], ["--config", config, "--print-config"],
                              ["--config", config, "--check"], ["--config", config, "--check", "--print-config"]):
                self.refused(CLESD, *arguments, env=clean_environment())
        for arguments in (["--version"], ["--help"], ["help", "pull"], ["completion", "bash"]):
            self.refused(CLES, *arguments, env=environment())

    def test_a_reader_that_has_gone_is_no_error(self):
        read, write = os.pipe()
        os.close(read)
        done = subprocess.run([CLESD, "--version"], stdout=write, stderr=subprocess.PIPE, timeout=PATIENCE, check=False)
        os.close(write)
        self.assertEqual((done.returncode, done.stderr), (0, b""))


class Help(unittest.TestCase):
    def test_help_fits_the_terminal(self):
        plain = subprocess.run([CLESD, "--help"], capture_output=True, text=True, timeout=PATIENCE, check=True).stdout
        for width in (60, 100):
            code, shown = on_terminal("--help", columns=width, program=CLESD)
            self.assertEqual(code, 0)
            text, _, examples = shown.replace("\r\n", "\n").partition("\nExamples:")
            self.assertEqual([line for line in text.split("\n") if len(line) > width and " " in line.strip()], [])
            self.assertEqual(text.split(), plain.partition("\nExamples:")[0].split())
            self.assertEqual(examples.split(), plain.partition("\nExamples:")[2].split())


if __name__ == "__main__":
    unittest.main()
