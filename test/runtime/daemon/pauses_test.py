#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""A daemon that was suspended, as by a debugger or a laptop's lid, starts no job that was withdrawn, or whose deadline
passed, in the meantime."""

import contextlib
import os
import signal
import time
import unittest

from daemon import DEFAULTS, Daemon, Folder, body
from support import PATIENCE, wait_until

COUNTING = os.environ.get("COUNTING_PLUGIN", "")
PAUSE = 1.0  # seconds
JOB = 1.0 * max(PATIENCE / 30, 1)  # seconds: longer than it takes to queue 20 jobs and to pause, with a sanitizer too


class Pauses(unittest.TestCase):
    def setUp(self):
        opened = contextlib.ExitStack()
        self.addCleanup(opened.close)
        folder = opened.enter_context(Folder())
        self.marks_file = folder.write("", "marks")
        plugin = f"plugins: [{{path: {COUNTING}, config: {{marks: {self.marks_file}}}}}]\n"
        self.daemon = opened.enter_context(Daemon(plugin, base=DEFAULTS.replace("workers: 2", "workers: 1")))

    def begun(self):
        with open(self.marks_file, encoding="utf-8") as marks:
            return [int(line.split()[0]) for line in marks]

    @contextlib.contextmanager
    def paused(self, seconds=PAUSE):
        process = self.daemon.process
        process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOWAIT)
        try:
            yield
            time.sleep(seconds)  # time has to pass
        finally:
            process.send_signal(signal.SIGCONT)

    def errors(self, links):
        return sorted(body(link.read())["error"] for link in links)

    def serves(self, number):
        """Serves requests again."""
        self.assertEqual(self.daemon.ask(f"DELEGATE sat1:once/{number}/0"), '{"value":"sat1"}')

    def test_withdrawn_and_late_jobs_in_the_queue_do_not_start(self):
        for attempt in range(5):
            first = 1000 * attempt
            with self.daemon.connect() as link, self.daemon.connect() as other:
                # Ends while the daemon is stopped, not before, and leaves the only worker to the next.
                link.send(f"DELEGATE sat1:once/{first}/{round(JOB * 1000)} id=1")
                wait_until(lambda n=first: n in self.begun(), "the first has begun")
                for id_ in range(2, 12):
                    link.send(f"DELEGATE sat1:once/{first + id_}/0 id={id_} deadline=60000")
                for id_ in range(12, 22):
                    other.send(f"DELEGATE sat1:once/{first + id_}/0 id={id_} deadline={round(JOB * 800)}")
                wait_until(lambda: '"queued":20' in self.daemon.ask("PULL self:cles/metrics"), "20 wait")
                with self.paused(max(PAUSE, JOB)):
                    for id_ in range(2, 12):
                        link.send(f"PUSH self:cles/cancel/{id_} reply=no")
                answers = [link.read() for _ in range(11)]
                self.assertEqual(sum("cancelled" in each for each in answers), 10, answers)
                self.assertEqual(self.errors([other] * 10), ["deadline"] * 10)
                self.serves(first + 99)
            self.assertEqual([n - first for n in self.begun() if n >= first], [0, 99])

    def test_jobs_sent_and_withdrawn_during_the_pause_do_not_start(self):
        for attempt in range(5):
            first = 1000 * attempt
            with contextlib.ExitStack() as opened:
                links = [opened.enter_context(self.daemon.connect()) for _ in range(10)]
                for link in links:
                    link.ask("PULL self:cles")
                with self.paused():
                    for number, link in enumerate(links):
                        link.send(f"DELEGATE sat1:once/{first + number}/0 id=1 deadline=60000")
                    for link in links:
                        link.send("PUSH self:cles/cancel/1 reply=no")
                self.assertEqual(self.errors(links), ["cancelled"] * 10)
                self.serves(first + 99)
            self.assertEqual([n - first for n in self.begun() if n >= first], [99])
        self.daemon.wait_for_entry("until the input that arrived since has been read")

    def test_nor_do_they_after_short_pauses_of_an_idle_daemon(self):
        """No longer than those that it cannot tell from a wait for work; whether they are withdrawn or their links are
        closed."""
        for attempt, seconds in enumerate((0.15, 0.3, 0.45, 0.6, 0.8)):
            first = 1000 * attempt
            with contextlib.ExitStack() as opened:
                links = [opened.enter_context(self.daemon.connect()) for _ in range(40)]
                for link in links:
                    link.ask("PULL self:cles")
                with self.paused(seconds):
                    for number, link in enumerate(links):
                        link.send(f"DELEGATE sat1:once/{first + number}/0 id=1 deadline=60000")
                    for number, link in enumerate(links):
                        if number % 2:
                            link.send("PUSH self:cles/cancel/1 reply=no")
                        else:
                            link.close()
                self.assertEqual(self.errors(links[1::2]), ["cancelled"] * 20)
                self.serves(first + 99)
            self.assertEqual([n - first for n in self.begun() if n >= first], [99], f"after {seconds} s")

    def test_other_jobs_start(self):
        with self.daemon.connect() as link:
            with self.paused():
                link.send("DELEGATE sat1:once/1/0 id=1 deadline=60000")
            self.assertEqual(link.read(), 'id=1 {"value":"sat1"}')


if __name__ == "__main__":
    unittest.main()
