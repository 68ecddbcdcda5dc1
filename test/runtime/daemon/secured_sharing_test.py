#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Daemons of a secured fleet share the jobs for whose requesters they may forward."""

import os
import shutil
import socket
import subprocess
import unittest

from daemon import clean_environment
from fleet import COUNTING
from secured import Fleet, Node
from support import CLES, PATIENCE, wait_until


class SecuredSharing(unittest.TestCase):
    def start(self, *forwards):
        """car1 and car2, with one worker each, and a member that submits jobs to car1."""
        self.fleet = Fleet("car1", "car2", "operator")
        self.addCleanup(self.fleet.__exit__)
        if forwards:
            self.fleet.run("fleet", "rights", "car1", *forwards, "-k", self.fleet.authority)
            for name in ("car1", "car2", "operator"):
                self.fleet.run("keys", "join", os.path.join(self.fleet.authority, "roster"), "-k", self.fleet.keys(name))
        folder = self.fleet.file("plugins")
        os.makedirs(folder)
        os.chmod(folder, 0o755)
        plugin = os.path.join(folder, "counting.so")
        shutil.copyfile(COUNTING, plugin)
        os.chmod(plugin, 0o755)
        self.marks_file = self.fleet.write("", "marks")
        more = (f"drain: 500ms\nplugin_path: {folder}\n"
                f"plugins: [{{path: counting.so, config: {{marks: {self.marks_file}}}}}]\n")
        self.car1, self.car2 = (self.node(name, more) for name in ("car1", "car2"))
        wait_until(lambda: self.car1.peers() == {"car2"} and self.car2.peers() == {"car1"}, "they know each other")

    def node(self, name, more):
        node = Node(self.fleet, name, more)
        self.addCleanup(node.__exit__)
        return node

    def submit(self, number):
        """A job of the operator that holds a worker until the test ends."""
        job = subprocess.Popen([CLES, "delegate", f"car1:holds/{number}", "-k", self.fleet.keys("operator"), "--at",
                                self.car1.url], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL, env=clean_environment(CLES_MULTICAST="off"))
        self.addCleanup(job.wait, PATIENCE)
        self.addCleanup(job.kill)

    def marks(self):
        """By the number of a job that has begun: its node."""
        with open(self.marks_file, encoding="utf-8") as marks:
            return dict(line.split() for line in marks.read().splitlines())

    def begun(self, number, where):
        wait_until(lambda: self.marks().get(number) == where, f"job {number} runs at {where}")

    def test_a_job_moves_if_the_node_may_forward_for_its_requester(self):
        self.start("--forwards", "operator")
        self.submit(1)
        self.begun("1", "car1")
        self.submit(2)
        self.begun("2", "car2")
        self.assertFalse([line for line in self.car1.messages() if "do not move" in line])

    def test_a_job_stays_otherwise_and_the_log_says_why(self):
        self.start()
        self.submit(1)
        self.begun("1", "car1")
        self.submit(2)
        wait_until(lambda: '"queued":1' in self.car1.ask("PULL self:cles"), "the second waits")
        with socket.socket(socket.AF_UNIX) as link:  # a job of the node itself, which comes later
            link.connect(self.car1.socket)
            link.sendall(b"DELEGATE car1:holds/3 id=1\n")
            self.begun("3", "car2")
            self.assertEqual(self.marks(), {"1": "car1", "3": "car2"})
        why = ("jobs of operator do not move to other nodes, because car1 may not forward for it (cles fleet rights car1 "
               "--forwards operator)")
        self.assertEqual(self.car1.messages().count(why), 1)


if __name__ == "__main__":
    unittest.main()
