#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""clesd with a plugin in a process of its own: it serves as in the daemon, and whatever it does ends only that process."""

import collections
import datetime
import errno
import hashlib
import json
import os
import re
import resource
import signal
import socket
import time
import unittest

from daemon import (DEFAULTS, HOSTILE, PLUGINS, STUBBORN, Daemon, Folder, body, clean_environment, clesd,
                    wait_until_running)
from support import PATIENCE, cles, wait_until

# Sanitizers turn some ends into others, and need more memory than a limit allows.
SANITIZED = os.environ.get("SANITIZED", "") != ""


EXITED = "ended itself with exit code "  # that of a sanitizer, if it cannot look for leaks by tracing the process
LAST_WORDS = "last output: '" + ("" if SANITIZED else "about to crash'")  # a sanitizer says more
PATIENT = f"deadline={int(PATIENCE * 1000)}"
SHORT = "deadline=1000"  # yet a job has begun by then on a busy machine
# A job of the daemon that takes longer than the restart of a plugin.
BELOW, PRIMES = ((2_000_000, {"count": 148933, "largest": 1999993}) if SANITIZED else
                 (20_000_000, {"count": 1270607, "largest": 19999999}))


def plugin(more="", limits="", path=HOSTILE, neighbour=f"{PLUGINS}/libcles-primes.so"):
    """The entry of an isolated plugin, beside one in the daemon."""
    text = f"plugins:\n  - {neighbour}\n  - path: {path}\n    isolation: process\n"
    if limits:
        text += f"    limits: {{{limits}}}\n"
    if more:
        text += f"    config: {{{more}}}\n"
    return text


def exists(process):
    """Whether it runs: not even as a zombie."""
    try:
        with open(f"/proc/{process}/stat", encoding="utf-8") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


class IsolatingDaemon(Daemon):
    def ask(self, line):
        """The reply, once a plugin's process that is being started again serves.

        Jobs wait a second for it; on a busy machine the start takes longer, and they are refused.
        """
        end = time.monotonic() + PATIENCE
        while True:
            reply = super().ask(line)
            if not self.starts_again(reply) or time.monotonic() > end:
                return reply
            time.sleep(body(reply)["retry_ms"] / 1000)

    @staticmethod
    def starts_again(reply):
        return '"error":"busy"' in reply and "is being started again" in reply

    def restart_took(self):
        """Seconds from the first end of the process until it served again."""
        ended, serves = (datetime.datetime.fromisoformat(self.wait_for_entry(words)["time"])
                         for words in ("Restarting.", "runs again, in process"))
        return (serves - ended).total_seconds()


class Isolated(unittest.TestCase):
    """One daemon for each test."""

    MORE = ""
    LIMITS = ""
    CONFIG = ""

    def setUp(self):
        more = "stuck_after: 400ms\ndrain: 500ms\n" + self.MORE
        self.daemon = IsolatingDaemon(plugin(self.CONFIG, self.LIMITS) + more,
                                      env=clean_environment(TZ="Antarctica/Troll", SECRET="x"))
        self.addCleanup(self.daemon.__exit__)

    def tearDown(self):
        """The daemon has not noticed."""
        if self.daemon.process.poll() is None:
            self.assertEqual(body(self.daemon.ask("PULL sat1:prime/7")), {"value": True})
            self.assertEqual(self.daemon.stop()[0], 0)

    def figures(self):
        return json.loads(self.daemon.ask("PULL self:cles/metrics"))["isolated"][0]

    def process(self):
        return json.loads(self.daemon.ask("PULL self:process"))["value"]

    def stop_counts(self):
        return json.loads(self.daemon.ask("PULL self:stops"))


class Ends(Isolated):
    """Each of these ends the process, and costs the jobs that ran there one `failed` each."""

    def ends(self, command, words, own=True, code="failed"):
        """Runs a command that ends the process, next to a job that runs there and one that runs in the daemon.

        The reason in the replies and in the log matches `words`.
        """
        before = self.process()
        with self.daemon.connect() as link:
            link.send(f"DELEGATE self:listens id=1 {PATIENT}")
            wait_until(lambda: self.figures()["jobs"] == 1, "it runs there")
            link.send(f'DELEGATE self:primes id=2 {PATIENT} {{"below":{BELOW}}}')
            link.send(f"{command} id=3")
            replies = {}
            while len(replies) < 3:
                reply = link.read()
                replies[reply.split()[0]] = body(reply)
        self.assertEqual(replies["id=2"], PRIMES)
        self.assertEqual(replies["id=1"]["error"], "failed")
        self.assertRegex(replies["id=1"]["message"], words)
        self.assertIn("the plugin 'hostile'", replies["id=1"]["message"])
        self.assertEqual(replies["id=3"]["error"], code)
        if own:
            self.assertEqual(replies["id=3"]["message"], replies["id=1"]["message"])
        self.assertEqual(self.daemon.ask("PULL self:quick"), '{"value":42}')
        self.assertNotEqual(self.process(), before)
        wait_until(lambda: not exists(before), "the old process is gone")
        entry = self.daemon.wait_for_entry("Restarting.")
        self.assertEqual(entry["level"], "error")
        self.assertIn("hostile: its process ", entry["message"])
        self.assertRegex(entry["message"], words)
        figures = self.figures()
        self.assertEqual((figures["name"], figures["state"], figures["ended"]), ("hostile", "running", 1))

    def test_no_other_program_inherits_what_it_needs_for_the_process(self):
        self.assertEqual(self.daemon.ask("PULL self:quick"), '{"value":42}')
        self.assertEqual(self.daemon.inherited(), [])

    def test_segmentation_fault(self):
        # A sanitizer reports it, and ends the process in a way of its own.
        self.ends("DELEGATE self:crashes", "ended" if SANITIZED else r"was ended by signal 11 \(SIGSEGV\)")

    def test_abort(self):
        self.ends("DELEGATE self:aborts", r"was ended by signal 6 \(SIGABRT\)")

    def test_exit(self):
        self.ends("DELEGATE self:exits/0", EXITED if SANITIZED else EXITED + "0")

    def test_exit_with_a_code(self):
        self.ends("DELEGATE self:exits/7", EXITED if SANITIZED else EXITED + "7")

    def test_kill(self):
        self.ends("DELEGATE self:kills_itself", r"was ended by signal 9 \(SIGKILL\)")

    def test_endless_loop(self):
        self.ends("DELEGATE self:loops deadline=100",
                  "was ended because DELEGATE 'loops' did not end within 400 ms of its deadline or cancellation",
                  own=False, code="deadline")
        metrics = json.loads(self.daemon.ask("PULL self:cles/metrics"))["pool"]
        self.assertEqual((metrics["stuck"], metrics["stuck_now"]), (0, 0))

    def test_an_endless_loop_after_the_answer(self):
        self.assertEqual(body(self.daemon.ask("DELEGATE self:answers_and_loops deadline=100")), {"value": 1})
        self.daemon.wait_for_entry("DELEGATE 'answers_and_loops' did not end within 400 ms")
        self.assertEqual(self.daemon.ask("PULL self:quick"), '{"value":42}')

    def test_an_endless_loop_that_is_cancelled(self):
        with self.daemon.connect() as link:
            link.send(f"DELEGATE self:loops id=1 {PATIENT}")
            wait_until_running(self.daemon, 1)
            link.send("PUSH self:cles/cancel/1 reply=no")
            self.assertEqual(body(link.read())["error"], "cancelled")
        self.daemon.wait_for_entry("DELEGATE 'loops' did not end within 400 ms")
        self.assertEqual(self.daemon.ask("PULL self:quick"), '{"value":42}')

    def test_it_closes_its_connections(self):
        # It ends itself if it notices before it is killed.
        self.ends("DELEGATE self:closes_everything", f"was ended because it closed a connection|{EXITED}")

    def test_it_closes_its_control_connection(self):
        self.ends("DELEGATE self:closes_control", "was ended because it closed a connection")

    def test_it_closes_lanes_after_its_answer(self):
        with self.daemon.connect() as link:
            self.assertEqual(body(link.ask("DELEGATE self:closes_lanes")), {"value": 1})
            link.ask("PUSH self:now")
        self.daemon.wait_for_entry("its process was ended because it closed a connection. Restarting.")
        self.assertEqual(self.daemon.ask("PULL self:quick"), '{"value":42}')

    def test_it_drips(self):
        """Bytes that arrive do not delay the end of a job that is overdue."""
        self.ends(f"DELEGATE self:drips {SHORT}",
                  "was ended because DELEGATE 'drips' did not end within 400 ms of its deadline or cancellation",
                  own=False, code="deadline")

    def test_a_job_without_a_worker_does_not_end(self):
        """Its handler has returned, and it is not answered."""
        self.ends(f"DELEGATE self:keeps {SHORT}",
                  "was ended because DELEGATE 'keeps' did not end within 400 ms of its deadline or cancellation",
                  own=False, code="deadline")

    def test_a_job_whose_feed_has_ended_does_not_end(self):
        """While it waits for an update it is not overdue; afterwards it is."""
        self.ends(f"DELEGATE self:hoards {SHORT}",
                  "was ended because DELEGATE 'hoards' did not end within 400 ms of its deadline or cancellation",
                  own=False, code="deadline")

    def asks_for_ever(self, task):
        self.ends(f"DELEGATE self:{task} {SHORT}",
                  f"was ended because DELEGATE '{task}' did not end within 400 ms of its deadline or cancellation",
                  own=False, code="deadline")

    def test_a_job_that_asks_for_events_for_ever_does_not_end(self):
        self.asks_for_ever("insists")

    def test_a_job_that_asks_again_after_each_event_does_not_end(self):
        self.asks_for_ever("persists")

    def test_overdue_jobs_withdraw_it(self):
        for expected in ((1, "running"), (2, "running"), (3, "withdrawn")):
            self.assertEqual(body(self.daemon.ask("DELEGATE self:keeps deadline=200"))["error"], "deadline")
            wait_until(lambda: (self.figures()["ended"], self.figures()["state"]) == expected, f"it is {expected}")
        self.assertEqual(body(self.daemon.ask("PULL self:quick"))["error"], "no_task")
        self.daemon.wait_for_entry("third end within 60 s; the last: its process was ended because DELEGATE 'keeps'")

    @unittest.skipIf(SANITIZED, "with a sanitizer, going on takes longer than the grace")
    def test_a_job_that_waits_for_a_worker_is_not_overdue(self):
        before = self.process()
        with self.daemon.connect() as link, self.daemon.connect() as other:
            link.send(f"DELEGATE self:passes_on/DELEGATE%20self%3Alistens id=1 {PATIENT}")
            wait_until(lambda: self.stop_counts()[2] == 1, "it waits for the other job")
            for i in (1, 2):
                other.send(f'DELEGATE self:primes id={i} deadline=1500 {{"below":1000000000}}')
            wait_until_running(self.daemon, 2)
            link.send("PUSH self:cles/cancel/1 reply=no")
            self.assertEqual(body(link.read())["error"], "cancelled")
            for _ in range(2):
                self.assertEqual(body(other.read())["error"], "deadline")
            wait_until(lambda: self.figures()["jobs"] == 0, "it continues, and ends")
        self.assertEqual(self.process(), before)

    def test_signals_that_a_service_manager_sends_to_all_processes(self):
        before = self.process()
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            os.kill(before, number)
        self.assertEqual(self.process(), before)
        self.assertEqual(self.figures()["ended"], 0)

    def test_its_start_fails_for_a_while(self):
        """Without descriptors, for example: that is not the plugin's fault."""
        daemon = self.daemon.process.pid
        usual = resource.prlimit(daemon, resource.RLIMIT_NOFILE)
        before = self.process()
        resource.prlimit(daemon, resource.RLIMIT_NOFILE, (3, usual[1]))
        os.kill(before, signal.SIGKILL)
        for delay in (100, 200, 400):
            entry = self.daemon.wait_for_entry(f"Restarting in {delay} ms.")
            self.assertIn("its process could not be started: ", entry["message"])
        resource.prlimit(daemon, resource.RLIMIT_NOFILE, usual)
        wait_until(lambda: self.daemon.ask("PULL self:quick") == '{"value":42}', "it is back")

    def test_it_says_nonsense(self):
        self.ends("DELEGATE self:says_nonsense", "was ended because what it said is invalid")

    def test_somebody_kills_it(self):
        before = self.process()
        os.kill(before, signal.SIGKILL)
        wait_until(lambda: self.figures()["ended"] == 1, "the daemon notices")
        self.assertEqual(self.daemon.ask("PULL self:quick"), '{"value":42}')


class Queue(Isolated):
    """With one worker, jobs wait for those that crash."""

    def setUp(self):
        base = DEFAULTS.replace("workers: 2", "workers: 1")
        self.daemon = IsolatingDaemon(plugin() + "stuck_after: 400ms\n", base=base)
        self.addCleanup(self.daemon.__exit__)

    def test_queued_jobs_run_after_the_restart(self):
        with self.daemon.connect() as link:
            link.send("DELEGATE self:ages/100 id=1\nDELEGATE self:aborts id=2\n" +
                      "\n".join(f"PULL self:quick id={i}" for i in range(3, 40)))
            replies = {}
            for _ in range(39):
                reply = link.read()
                replies[int(reply.split()[0][3:])] = reply
        self.assertEqual(body(replies[1]), {"value": "aged"})
        self.assertEqual(body(replies[2])["error"], "failed")
        # Jobs wait a second for the process.
        slow = self.daemon.restart_took() > 0.9
        for i in range(3, 40):
            if not (slow and self.daemon.starts_again(replies[i])):
                self.assertEqual(replies[i], f'id={i} {{"value":42}}')
        pool = json.loads(self.daemon.ask("PULL self:cles/metrics"))["pool"]
        self.assertGreaterEqual(pool["admitted"], 39)


class Withdrawal(Isolated):
    def crash(self):
        self.assertEqual(body(self.daemon.ask("DELEGATE self:aborts"))["error"], "failed")

    def tasks(self):
        return {task["task"] for task in json.loads(self.daemon.ask("PULL self:cles"))["tasks"]}

    def test_three_ends_withdraw_the_tasks_until_sighup(self):
        self.assertEqual(self.daemon.ask("PUSH self:publish/7"), "{}")
        wait_until(lambda: "topic" in self.tasks() and
                   self.daemon.ask("BIND self:topic/7") == '{"value":7}', "it is published")
        for _ in range(3):
            self.crash()
        entry = self.daemon.wait_for_entry("Its tasks are withdrawn until SIGHUP.")
        self.assertIn("third end within 60 s; the last: its process was ended by signal 6 (SIGABRT). ", entry["message"])
        self.assertEqual(body(self.daemon.ask("PULL self:quick"))["error"], "no_task")
        tasks = self.tasks()
        self.assertFalse({"aborts", "caller", "notice", "silent"} & tasks, tasks)
        self.assertIn("primes", tasks)
        figures = self.figures()
        self.assertEqual((figures["state"], figures["ended"], figures["process"]), ("withdrawn", 3, 0))
        self.daemon.send_signal(signal.SIGHUP)
        self.daemon.wait_for_entry("its tasks were withdrawn. Restarting on SIGHUP with the new configuration.")
        wait_until(lambda: self.daemon.ask("PULL self:quick") == '{"value":42}', "it is back")
        self.assertTrue({"aborts", "caller", "topic", "notice", "silent"} <= self.tasks())
        self.crash()  # the past is forgotten
        self.assertEqual(self.daemon.ask("PULL self:quick"), '{"value":42}')

    def withdraw(self):
        for _ in range(3):
            self.crash()
        wait_until(lambda: self.figures()["state"] == "withdrawn", "they are withdrawn")

    def reload(self, change):
        with open(self.daemon.config, encoding="utf-8") as file:
            text = file.read()
        self.daemon.write(change(text))
        self.daemon.send_signal(signal.SIGHUP)

    def test_sighup_applies_new_limits_and_settings(self):
        self.withdraw()
        self.reload(lambda text: text.replace("isolation: process\n",
                                              "isolation: process\n    limits: {open_files: 99}\n"
                                              "    config: {padding: abc}\n"))
        self.daemon.wait_for_entry("Restarting on SIGHUP with the new configuration.")
        wait_until(lambda: self.daemon.ask("PULL self:padding") == '{"value":3}', "it is back")
        self.daemon.wait_for_entry("no privileges, 99 open files")
        self.assertFalse([e for e in self.daemon.entries() if "other changes" in e["message"]])

    def test_sighup_with_an_invalid_configuration(self):
        self.withdraw()
        self.reload(lambda text: text + "nonsense: 1\n")
        self.daemon.wait_for_entry("kept the old configuration")
        self.daemon.wait_for_entry("Restarting on SIGHUP with the old configuration.")
        wait_until(lambda: self.daemon.ask("PULL self:quick") == '{"value":42}', "it is back")

    def test_all_that_it_has_published_is_retired(self):
        self.assertEqual(self.daemon.ask(f"PUSH self:publish_many/6000 {PATIENT}"), "{}")
        wait_until(lambda: self.daemon.ask("BIND self:topic/5999") == '{"value":5999}', "it is published")
        self.withdraw()
        self.assertEqual(self.daemon.ask("BIND self:topic/5999"), "{}")

    def test_other_nodes_are_told(self):
        base = DEFAULTS.replace("sat1", "sat2")
        with Daemon(f"seeds: {self.daemon.url}\n", base=base) as other:
            def ask():
                return body(other.ask("PULL any:quick deadline=2000"))

            wait_until(lambda: ask() == {"value": 42}, "it is found")
            for _ in range(3):
                self.crash()
            wait_until(lambda: ask().get("error") in ("no_task", "no_target"), "it is gone")
            self.daemon.send_signal(signal.SIGHUP)
            wait_until(lambda: ask() == {"value": 42}, "it is found again")
            self.assertEqual(other.stop()[0], 0)

    @unittest.skipUnless(os.environ.get("CLES_COMMAND"), "the command is not built")
    def test_the_doctor_says_so(self):
        for _ in range(3):
            self.crash()
        wait_until(lambda: self.figures()["state"] == "withdrawn", "they are withdrawn")
        _, out, err = cles("doctor", "-o", "table", "--at", self.daemon.url, "-m", "off")
        self.assertIn("the tasks of the plugin hostile of sat1 are withdrawn", out, err)

    def test_sighup_does_not_touch_a_plugin_that_runs(self):
        before = self.process()
        self.daemon.send_signal(signal.SIGHUP)
        self.daemon.wait_for_entry("reloaded the configuration")
        self.assertEqual(self.process(), before)


class Restart(unittest.TestCase):
    def test_a_plugin_that_crashes_whenever_it_is_started_again(self):
        with Folder() as f:
            broken = f.file("broken")
            with IsolatingDaemon(plugin(f"crash_while: {broken}", f"read: [{f.path}]")) as d:
                self.assertEqual(d.ask("PULL self:quick"), '{"value":42}')
                f.write("", "broken")
                self.assertEqual(body(d.ask("DELEGATE self:aborts"))["error"], "failed")
                entry = d.wait_for_entry("its process crashed again while starting: ")
                if not SANITIZED:
                    self.assertTrue(entry["message"].endswith(
                        ": signal 11 (SIGSEGV); last output: 'about to crash'. Restarting."), entry)
                entry = d.wait_for_entry("Its tasks are withdrawn")
                self.assertIn(LAST_WORDS, entry["message"])
                self.assertEqual(body(d.ask("PULL self:quick"))["error"], "no_task")
                os.unlink(broken)
                d.send_signal(signal.SIGHUP)
                wait_until(lambda: d.ask("PULL self:quick") == '{"value":42}', "it is back")
                self.assertEqual(d.stop()[0], 0)


    def test_a_stop_during_a_restart(self):
        with Folder() as f:
            slow = f.file("slow")
            with Daemon(plugin(f"slow_while: {slow}", f"read: [{f.path}]")) as d:
                f.write("", "slow")
                self.assertEqual(body(d.ask("DELEGATE self:aborts"))["error"], "failed")
                d.wait_for_entry("Restarting.")
                self.assertEqual(d.stop()[0], 0)

    def test_a_path_that_is_missing_then(self):
        """A device may be unplugged."""
        with Folder() as f, Folder() as g:
            with IsolatingDaemon(plugin(limits=f"read: [{f.path}], write: [{g.path}]")) as d:
                if "Landlock" not in d.wait_for_entry("confined to")["message"]:
                    self.skipTest("this kernel has no Landlock")
                os.rename(g.path, g.path + "-away")
                try:
                    self.assertEqual(body(d.ask("DELEGATE self:aborts"))["error"], "failed")
                    entry = d.wait_for_entry("it cannot use a path of its 'limits.write': " + g.path)
                    self.assertEqual(entry["level"], "warning")
                    self.assertEqual(d.ask("PULL self:quick"), '{"value":42}')
                finally:
                    os.rename(g.path + "-away", g.path)
                self.assertEqual(d.stop()[0], 0)


class Start(unittest.TestCase):
    def refused(self, entry, words, check=True):
        """A required one prevents the start; without another one the daemon continues."""
        with Folder() as f:
            file = f.write(DEFAULTS + entry)
            if check:
                self.assertEqual(clesd("--config", file, "--check")[0], 2)
            code, out, err = clesd("--config", file)
            said = err.splitlines()[-1]
            self.assertEqual((code, out), (2, ""), err)
            self.assertIn(words, said)
            self.assertIn(": plugins[1].", said)
        with Daemon(entry + "    required: false\n") as d:
            entry = d.wait_for_entry("continuing without it")
            self.assertIn(words, entry["message"])
            self.assertNotIn("error", json.loads(d.ask("PULL self:cles/metrics")))
            self.assertEqual(body(d.ask("PULL sat1:caller"))["error"], "no_task")
            self.assertEqual(d.stop()[0], 0)

    def test_its_file_is_checked(self):
        with open(HOSTILE, "rb") as file:
            digest = hashlib.sha256(file.read()).hexdigest()
        with IsolatingDaemon(plugin() + f"    sha256: {digest}\n") as d:
            self.assertEqual(d.ask("PULL self:quick"), '{"value":42}')
            self.assertEqual(body(d.ask("DELEGATE self:aborts"))["error"], "failed")
            self.assertEqual(d.ask("PULL self:quick"), '{"value":42}')
            self.assertEqual(d.stop()[0], 0)
        self.refused(plugin() + f"    sha256: {'0' * 64}\n", "not the configured one")

    def test_it_crashes_at_its_start(self):
        """In the daemon, this would end the daemon."""
        self.refused(plugin("crash_at_start: true"), LAST_WORDS, check=False)

    def test_its_settings_are_wrong(self):
        self.refused(plugin("crash_at_stat: true"), "it has no setting 'crash_at_stat'")

    def test_another_plugin_has_a_task(self):
        with Folder() as f:
            copy = f.file("copy.so")
            with open(STUBBORN, "rb") as source, open(copy, "wb") as out:
                out.write(source.read())
            self.refused(plugin(path=copy, neighbour=STUBBORN), "quick", check=False)

    def test_a_path_that_it_may_use_is_missing(self):
        for key in ("read", "write"):
            self.refused(plugin(limits=f"{key}: [/nowhere/at/all]"),
                         f"plugins[1].limits.{key}: {HOSTILE}: /nowhere/at/all: No such file or directory")

    def test_many_settings(self):
        """More than a socket takes at once, at the start and at a restart."""
        with IsolatingDaemon(plugin(f"padding: {'x' * 300_000}")) as d:
            self.assertEqual(d.ask("PULL self:padding"), '{"value":300000}')
            self.assertEqual(body(d.ask("DELEGATE self:aborts"))["error"], "failed")
            self.assertEqual(d.ask("PULL self:padding"), '{"value":300000}')
            self.assertEqual(d.stop()[0], 0)

    @unittest.skipIf(SANITIZED, "a sanitizer needs too much memory for a limit")
    def test_many_workers_and_little_memory(self):
        """The stacks of the daemon's threads do not count."""
        base = DEFAULTS.replace("workers: 2", "workers: 60")
        with Daemon(plugin(limits="memory: 64MiB"), base=base) as d:
            self.assertEqual(d.ask("PULL self:quick"), '{"value":42}')
            self.assertEqual(d.stop()[0], 0)

    def test_settings(self):
        for entry, words in (("isolation: thread", "'thread' is neither process nor none"),
                             ("limits: {memory: 1GiB}", "has 'limits', which require 'isolation: process'"),
                             ("isolation: process\n    limits: {memory: 1MiB}", "memory"),
                             ("isolation: process\n    limits: {read: models}", "'models' is not an absolute path"),
                             ("isolation: process\n    limits: {cores: 1}",
                              "unknown key; known here: memory, open_files, read, write")):
            with self.subTest(entry), Folder() as f:
                file = f.write(DEFAULTS + f"plugins:\n  - path: {HOSTILE}\n    {entry}\n")
                code, _, err = clesd("--config", file, "--check")
                self.assertEqual(code, 2)
                self.assertIn(words, err)

    def test_the_settings_are_printed(self):
        with Folder() as f:
            file = f.write(DEFAULTS + plugin(limits="memory: 512MiB, write: /dev/null"))
            code, out, err = clesd("--config", file, "--print-config")
            self.assertEqual((code, err), (0, ""))
            self.assertIn("    isolation: process\n    limits: {memory: 536870912, open_files: 256, read: [], "
                          'write: ["/dev/null"]}', out)
            again = f.write(out, "again.yaml")
            self.assertEqual(clesd("--config", again, "--check")[0], 0)

    def test_the_mode_is_for_internal_use(self):
        for arguments in ((), ("1", "x", "y"), ("0", "1", "y")):
            with self.subTest(arguments):
                self.assertEqual(clesd("--plugin-process", *arguments),
                                 (2, "", "clesd: --plugin-process is for internal use; run clesd without it\n"))


class End(Isolated):
    def test_it_ends_with_the_daemon(self):
        process = self.process()
        code, took = self.daemon.stop()
        self.assertEqual(code, 0)
        self.assertLess(took, 4)
        self.assertFalse(exists(process))
        self.assertFalse([e for e in self.daemon.entries() if e["level"] == "error"])

    def test_it_says_much_when_it_stops(self):
        with Daemon(plugin("talk_at_stop: true")) as d:
            self.assertEqual(d.ask("PULL self:last_words"), '{"value":true}')
            self.assertEqual(d.stop()[0], 0)
            self.assertNotIn("did not stop in time", d.log())
            self.assertIn("hostile: last word 0", d.log())

    def test_it_ends_when_the_daemon_is_killed(self):
        process = self.process()
        self.daemon.process.kill()
        self.daemon.process.wait()
        wait_until(lambda: not exists(process), "it ends")

    def test_a_job_that_does_not_end(self):
        process = self.process()
        with self.daemon.connect() as link:
            link.send(f"DELEGATE self:loops id=1 {PATIENT}")
            wait_until_running(self.daemon, 1)
            code, took = self.daemon.stop()
            self.assertEqual(code, 0)
            self.assertLess(took, 6)
            self.assertEqual(body(link.read())["error"], "unavailable")
        self.assertFalse(exists(process))

    def test_a_second_signal(self):
        process = self.process()
        with self.daemon.connect() as link:
            link.send(f"DELEGATE self:loops id=1 {PATIENT}")
            wait_until_running(self.daemon, 1)
            self.daemon.send_signal(signal.SIGTERM)
            self.daemon.wait_for_entry("stopping on SIGTERM")
            self.daemon.send_signal(signal.SIGTERM)
            self.assertEqual(self.daemon.end()[0], 0)
        wait_until(lambda: not exists(process), "it ends")


class Confinement(Isolated):
    def setUp(self):
        self.folder = Folder()
        self.addCleanup(self.folder.__exit__)
        for name in ("readable/file", "writable/file", "else/file"):
            self.folder.write("text", name)
        self.LIMITS = (f"memory: 256MiB, open_files: 32, read: [{self.folder.file('readable')}], "
                       f"write: {self.folder.file('writable')}")
        super().setUp()
        self.in_force = self.daemon.wait_for_entry("confined to")["message"]

    def outcome(self, task, what):
        return json.loads(self.daemon.ask(f"PULL self:{task}/{str(what).replace('/', '%2F')}"))["value"]

    def test_files(self):
        if "Landlock" not in self.in_force or "no Landlock" in self.in_force:
            self.skipTest("this kernel has no Landlock")
        f = self.folder
        for path, reads, writes in ((f.file("readable/file"), 0, errno.EACCES),
                                    (f.file("writable/file"), 0, 0),
                                    (f.file("writable/new"), 0, 0),
                                    (f.file("else/file"), errno.EACCES, errno.EACCES),
                                    (self.daemon.config, errno.EACCES, errno.EACCES),
                                    ("/proc/meminfo", 0, errno.EACCES),
                                    (f"/proc/{self.daemon.process.pid}/environ", errno.EACCES, errno.EACCES),
                                    ("/etc/shadow", errno.EACCES, errno.EACCES),
                                    ("/dev/zero", errno.EACCES, errno.EACCES),
                                    ("/dev/null", 0, 0)):
            with self.subTest(path):
                self.assertEqual(self.outcome("writes", path), writes)
                self.assertEqual(self.outcome("reads", path), reads)

    def test_other_processes(self):
        if "a filter of system calls" not in self.in_force:
            self.skipTest("this kernel has no seccomp")
        daemon = self.daemon.process.pid
        for task in ("signals", "traces", "limits", "pins", "schedules", "renices", "sets_io_priority", "sets_owner",
                     "sets_owner_by_ioctl"):
            with self.subTest(task):
                self.assertEqual(self.outcome(task, daemon), errno.EPERM)
        for task in ("limits", "pins", "schedules", "renices", "sets_io_priority"):
            for itself in (0, self.process()):
                with self.subTest(task, itself=itself):
                    self.assertEqual(self.outcome(task, itself), 0)
        self.assertEqual(self.outcome("signals", self.process()), 0)
        self.assertEqual(self.outcome("signals", -1), errno.EPERM)
        self.assertEqual(self.outcome("renices_group", 0), errno.EPERM)
        self.assertEqual(self.outcome("sets_signal", signal.SIGUSR1), errno.EPERM)
        with open(f"/proc/{daemon}/limits", encoding="utf-8") as file:
            self.assertNotRegex(file.read(), r"Max core file size +0 +0 ")

    def test_it_stays_one_process_and_ends_with_the_daemon(self):
        if "a filter of system calls" not in self.in_force:
            self.skipTest("this kernel has no seccomp")
        for task in ("forks", "clones", "begins_a_session", "changes_group", "makes_memory", "shares_memory",
                     "outlives"):
            with self.subTest(task):
                self.assertEqual(self.outcome(task, 0), errno.EPERM)
        self.assertEqual(self.outcome("clones_3", 0), errno.ENOSYS)
        # What is shared is not counted by the limit on memory.
        self.assertEqual(self.outcome("maps_memory", 1), errno.ENOMEM)
        self.assertEqual(self.outcome("maps_memory", 0), 0)
        self.assertEqual(self.outcome("starts_a_thread", 0), 0)

    def test_attributes_of_files(self):
        if "a filter of system calls" not in self.in_force:
            self.skipTest("this kernel has no seccomp")
        for task in ("changes_mode", "changes_owner", "changes_time", "changes_attribute"):
            with self.subTest(task):
                self.assertEqual(self.outcome(task, 0), errno.EPERM)

    def test_sockets(self):
        if "a filter of system calls" not in self.in_force:
            self.skipTest("this kernel has no seccomp")
        self.assertEqual(self.outcome("opens_a_socket", int(socket.AF_UNIX)), errno.EPERM)
        self.assertEqual(self.outcome("opens_a_socket", int(socket.AF_INET)), 0)
        self.assertEqual(self.outcome("opens_a_pair", int(socket.SOCK_DGRAM)), errno.EPERM)
        self.assertEqual(self.outcome("opens_a_pair", int(socket.SOCK_STREAM)), 0)

    def test_its_environment(self):
        for name, value in (("TZ", "Antarctica/Troll"), ("SECRET", "")):
            self.assertEqual(self.outcome("variable", name), value, name)

    def test_its_arguments(self):
        with open(f"/proc/{self.process()}/cmdline", encoding="utf-8") as file:
            self.assertEqual(file.read().split("\0")[4], "hostile.so")

    def test_updates_of_other_tasks_are_dropped(self):
        self.assertEqual(self.daemon.ask("PUSH self:publish_elsewhere"), "{}")
        entry = self.daemon.wait_for_entry("an update of 'prime/1' was dropped: it is no task of the plugin")
        self.assertEqual(entry["level"], "warning")

    def test_log_entries_are_cut(self):
        self.assertEqual(self.daemon.ask("PUSH self:logs_much"), "{}")
        self.assertEqual(len(self.daemon.wait_for_entry("hostile: much ")["message"]), len("hostile: ") + 4096)

    def test_its_limits(self):
        with open(f"/proc/{self.process()}/limits", encoding="utf-8") as file:
            limits = {line[:26].strip(): line[26:].split()[0] for line in file}
        self.assertEqual(limits["Max core file size"], "0")
        self.assertLess(int(limits["Max open files"]), 100)
        if not SANITIZED:
            stack = int(limits["Max stack size"]) if limits["Max stack size"].isdigit() else 2 << 20
            self.assertEqual(limits["Max data size"], str((256 << 20) + 6 * stack))
        with open(f"/proc/{self.process()}/status", encoding="utf-8") as file:
            self.assertRegex(file.read(), "CapPrm:\t0+\nCapEff:\t0+\n(.*\n)*NoNewPrivs:\t1\n")

    @unittest.skipIf(SANITIZED, "a sanitizer needs too much memory for a limit")
    def test_memory(self):
        """The job gets an exception, and the process goes on."""
        before = self.process()
        answer = body(self.daemon.ask("DELEGATE self:exhausts_memory"))
        self.assertEqual(answer["error"], "failed")
        self.assertEqual(self.daemon.ask("PULL self:quick"), '{"value":42}')
        self.assertEqual(self.process(), before)

    @unittest.skipIf(SANITIZED, "a sanitizer opens files")
    def test_it_inherits_nothing(self):
        """Control and the lanes: workers and replacements."""
        self.assertEqual(json.loads(self.daemon.ask("PULL self:descriptors")), list(range(3, 3 + 1 + 6)))

    def test_its_output_is_logged(self):
        self.assertEqual(self.daemon.ask("PUSH self:says/hello"), "{}")
        for words in ("hostile: hello", "hostile: hello too"):
            self.assertEqual(self.daemon.wait_for_entry(words)["level"], "info")

    def test_much_output_is_cut(self):
        self.assertEqual(self.daemon.ask("PUSH self:says_much deadline=30000"), "{}")
        self.assertEqual(self.daemon.ask("PULL self:quick"), '{"value":42}')
        wait_until(lambda: self.daemon.log().count("hostile: line ") >= 200, "a part of it is logged")
        self.assertLess(self.daemon.log().count("hostile: line "), 5000)


class Shipped(unittest.TestCase):
    """The plugins that are part of CLES work in a process of their own."""

    def test_each(self):
        if not PLUGINS:
            self.skipTest("they are not built")
        names = ("system", "primes", "sgd", "fmv", "strike")
        entries = "".join(f"  - path: {PLUGINS}/libcles-{name}.so\n    isolation: process\n" for name in names)
        with Daemon("plugins:\n" + entries) as d:
            self.assertIn("seconds", body(d.ask("PULL self:utc")))
            for task in ("load", "memory", "disk", "network", "processes"):
                with self.subTest(task):
                    self.assertNotIn("error", body(d.ask(f"PULL self:{task}")))
            self.assertEqual(body(d.ask('DELEGATE self:primes {"below":100000}')), {"count": 9592, "largest": 99991})
            self.assertEqual(body(d.ask('DELEGATE self:primes_in_parts {"below":100000,"parts":4}'))["count"], 9592)
            told = body(d.ask("PULL self:cles/types/primes"))["DELEGATE"]
            self.assertEqual(told["body"]["$defs"]["range"]["required"], ["below"])
            self.assertEqual(sorted(told["result"]["$defs"]["found"]["properties"]), ["count", "largest"])
            with d.connect() as link:
                self.assertIn("seconds", body(link.ask("BIND self:utc")) or {"seconds": 0})
                self.assertTrue(link.read().startswith("UPDATE sat1:utc "))
            self.assertEqual(len(json.loads(d.ask("PULL self:cles/metrics"))["isolated"]), len(names))
            self.assertEqual(d.stop()[0], 0)


class Same(unittest.TestCase):
    """A plugin serves the same in the daemon and in a process of its own."""

    @classmethod
    def setUpClass(cls):
        alone = f"plugins:\n  - path: {HOSTILE}\n"
        cls.here = Daemon(alone)
        cls.there = Daemon(alone + "    isolation: process\n")

    @classmethod
    def tearDownClass(cls):
        for d in (cls.here, cls.there):
            code, _ = d.stop()
            d.__exit__()
            assert code == 0

    def both(self, talk):
        """What a conversation returns, in both."""
        said = []
        for d in (self.here, self.there):
            with d.connect() as link:
                said.append(talk(link, d))
        self.assertEqual(said[0], said[1])
        return said[0]

    def test_replies(self):
        for line in ("PULL self:quick", "PULL self:caller", "PULL self:caller/a%20b/%C3%A4%25", "PUSH sat1:caller/1",
                     'PUSH self:caller {"x": [1, 2], "y": "\\u00e4"}', 'DELEGATE self:caller id=7 [1, 2]',
                     "PULL self:caller/" + "/".join("abcdefghijklmnopqrstuvwxyzabcd"), "PULL self:text",
                     "PULL self:list", 'PUSH self:swap {"x":1,"y":2}', 'PUSH self:swap {"x":1,"z":2}', "PUSH self:nothing",
                     "PULL self:large", "PULL self:too_large", "PULL self:looks_failed", "PULL self:throws",
                     "PULL self:denies", "PULL self:refuses", "PULL self:forgets", "PULL self:twice", "PULL self:later",
                     "PULL self:nowhere", "DELEGATE self:quick", "BIND self:topic", "BIND self:topic/7",
                     "BIND self:silent", "BIND self:nowhere", "UPDATE self:notice", "DELEGATE self:reports",
                     "PULL self:caller reply=no", "DELEGATE self:passes_on/PULL%20self%3Aquick",
                     "DELEGATE self:passes_on/PULL%20self%3Anowhere", "DELEGATE self:passes_on/PULL%20self%3Acaller",
                     "DELEGATE self:passes_on/nonsense", "DELEGATE self:passes_on/PULL%20car9%3Aspeed",
                     "DELEGATE self:follows/self%3Anowhere", "DELEGATE self:follows/car9%3Aspeed",
                     "DELEGATE self:follows/nonsense", "DELEGATE self:follows/self%3Atopic"):
            with self.subTest(line):
                self.both(lambda link, d: link.ask(line))

    def test_its_traces(self):
        trace = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-00"
        for noun in ("caller", "passes_on/DELEGATE%20self%3Acaller"):
            said = json.loads(self.both(lambda link, d, noun=noun: link.ask(f"DELEGATE self:{noun} trace={trace}")))
            self.assertEqual(said["trace"], trace)

    def test_its_description(self):
        self.both(lambda link, d: json.loads(link.ask("PULL self:cles"))["tasks"])

    def test_progress(self):
        def talk(link, d):
            link.send("DELEGATE self:reports id=7 progress=yes")
            return [link.read() for _ in range(5)]

        said = self.both(talk)
        self.assertEqual(said[1], 'id=7 progress=0.5 {"x":2,"y":0}')
        self.assertEqual(said[-1], 'id=7 {"value":"done"}')

    def test_much_progress(self):
        """Reports are left out when they come too fast, and the last line is the reply."""
        for d in (self.here, self.there):
            with d.connect() as link:
                link.send("DELEGATE self:reports_much id=7 progress=yes")
                last = 0
                for line in iter(link.read, 'id=7 {"value":"done"}'):
                    fraction = float(re.match(r"id=7 progress=(\S+) \{\}$", line)[1])
                    self.assertGreaterEqual(fraction, last)
                    last = fraction

    def test_progress_of_a_request_that_is_passed_on(self):
        def talk(link, d):
            link.send("DELEGATE self:passes_on/DELEGATE%20self%3Areports id=7 progress=yes")
            return [line for line in iter(link.read, 'id=7 {"value":"done"}')]

        self.assertEqual(self.both(talk), [f"id=7 progress={f} {{}}" for f in ("0.125", "0.25", "0.375", "0.5")])

    def test_an_update_at_the_start(self):
        for d in (self.here, self.there):
            wait_until(lambda: d.ask("BIND self:topic/0") == '{"value":"first"}', "it is published")

    def test_updates(self):
        def talk(link, d):
            said = [link.ask("BIND self:topic/7"), link.ask("BIND self:notice")]
            link.send("PUSH self:publish/7 id=1")
            said += [re.sub("epoch=[0-9a-f]{8} ", "", line) for line in sorted([link.read(), link.read()])]
            link.send('UPDATE self:notice id=2 {"text":"x"}')
            said += [re.sub("epoch=[0-9a-f]{8} ", "", line) for line in sorted([link.read(), link.read()])]
            return said

        said = self.both(talk)
        self.assertEqual(said[2], 'UPDATE sat1:topic/7 seq=1 {"value":7}')

    def test_feeds(self):
        def talk(link, d):
            link.ask("PUSH self:publish/5")
            wait_until(lambda: d.ask("BIND self:topic/5") == '{"value":5}', "it is published")
            link.send("DELEGATE self:follows/self%3Atopic%2F5 id=7 progress=yes")
            said = [link.read()]
            for _ in range(2):
                link.send("PUSH self:publish/5 reply=no")
                said.append(link.read())
            return [*said, link.read()]

        said = self.both(talk)
        self.assertEqual([body(line) for line in said], [{"x": 5, "y": 0}] * 3 + [{"value": 3}])

    def test_marks_of_events(self):
        def talk(link, d):
            link.ask("PUSH self:publish/6")
            wait_until(lambda: d.ask("BIND self:topic/6") == '{"value":6}', "it is published")
            return [link.ask(f"DELEGATE self:marks/self%3Atopic%2F6/{hops}") for hops in (0, 8, 17)]

        said = self.both(talk)
        self.assertEqual(said[:2], ["[1,1]", "[1,1]"])
        self.assertIn("hops", body(said[2])["message"])

    def test_events_do_not_come_beside_the_handler(self):
        for d in (self.here, self.there):
            self.assertEqual(d.ask("DELEGATE self:answers_first"), '{"value":1}')
            wait_until(lambda d=d: json.loads(d.ask("PULL self:late_events"))[0] == 1, "the event has come")
            self.assertEqual(d.ask("PULL self:late_events"), "[1,0]")

    def test_a_requester_does_not_wait_for_what_a_job_asks_after_its_answer(self):
        for d in (self.here, self.there):
            self.addCleanup(d.ask, "PUSH self:release")
            self.assertEqual(d.ask("DELEGATE self:asks_after_its_answer"), '{"value":1}')

    def test_feeds_end_with_their_jobs(self):
        for d in (self.here, self.there):
            def waiting(d=d):
                return json.loads(d.ask("PULL self:cles/metrics"))["pool"]["waiting"]

            with d.connect() as link:
                for i in range(1, 6):  # more than there are workers
                    link.send(f"DELEGATE self:follows/self%3Asilent id={i} {PATIENT}")
                wait_until(lambda: waiting() == 5, "all wait for an update")
                self.assertEqual(d.ask("PULL self:quick"), '{"value":42}')
                link.send("PUSH self:cles/cancel/3 reply=no")
                self.assertEqual(body(link.read())["error"], "cancelled")
            wait_until(lambda: waiting() == 0, "their requester is gone")
        wait_until(lambda: json.loads(self.there.ask("PULL self:cles/metrics"))["isolated"][0]["jobs"] == 0, "all have ended")

    def test_stops(self):
        """Cancellation, a deadline and a lost link reach a job while its handler runs, and after it has returned."""
        for d in (self.here, self.there):
            for task in ("waits", "listens"):
                with self.subTest(task), d.connect() as control:
                    def counts():
                        return json.loads(control.ask("PULL self:stops"))

                    before = counts()

                    def begun(number):
                        wait_until(lambda: counts()[2] - before[2] == number, "it runs")

                    with d.connect() as link:
                        link.send(f"DELEGATE self:{task} id=1 {PATIENT}")
                        begun(1)
                        link.send(f"DELEGATE self:{task} id=2 deadline=1000")
                        begun(2)
                        self.assertEqual(link.read().split()[:1], ["id=2"])
                        link.send("PUSH self:cles/cancel/1 id=3")
                        self.assertEqual({link.read().split()[0], link.read().split()[0]}, {"id=1", "id=3"})
                        link.send(f"DELEGATE self:{task} id=4 {PATIENT}")
                        begun(3)
                    wait_until(lambda: counts()[1] - before[1] == 3, "all are told")
                    if task == "waits":
                        wait_until(lambda: counts()[0] - before[0] == 3, "all have ended")

    def test_jobs_are_counted_by_the_pool(self):
        for d in (self.here, self.there):
            with d.connect() as link:
                for i in range(1, 4):
                    link.send(f"DELEGATE self:waits id={i} {PATIENT}")
                wait_until_running(d, 2)
                pool = json.loads(d.ask("PULL self:cles/metrics"))["pool"]
                self.assertEqual((pool["queued"], pool["running"]), (1, 2))
            wait_until_running(d, 0)


class Crowd(Isolated):
    MORE = "queue: 2000\n"  # none is refused because many wait

    def test_many_jobs_while_it_crashes(self):
        """Each request gets exactly one reply: those that were lost are `failed`, those that would have to wait for the
        plugin's process for too long are `busy`."""
        codes = collections.Counter()
        crashes = []
        with self.daemon.connect() as link:
            for begin in range(1, 2000, 100):
                link.send("\n".join(f"PULL self:quick id={i} {PATIENT}" for i in range(begin, begin + 100)))
                if begin in (501, 1201):
                    link.send(f"DELEGATE self:aborts id=900000 {PATIENT}")
                    while not (reply := link.read()).startswith("id=900000 "):
                        codes[body(reply).get("error")] += 1
                    crashes.append(body(reply)["error"])
            while codes.total() < 2000:
                codes[body(link.read()).get("error")] += 1
        self.assertIn(crashes, (["failed"] * 2, ["failed", "busy"]))
        self.assertLessEqual(set(codes), {None, "failed", "busy"})
        self.assertGreaterEqual(codes[None], 500)
        self.assertLessEqual(codes["failed"], 12)
        wait_until(lambda: "error" not in body(self.daemon.ask("PULL self:quick")), "it serves again")


if __name__ == "__main__":
    unittest.main()
