#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles jobs`: the jobs of nodes, and how one is cancelled; and the times of tasks in `cles top`."""

import json
import os
import signal
import tempfile
import unittest

from support import HAS_SECURITY, NodeTest, ScriptedNode, cles, finish, id_of, read_line, start, wait_until


class Jobs(NodeTest):
    def setUp(self):
        self.client = start("delegate", "car1:sleep/60000", "-t", "1min", "--at", self.node.url)
        self.addCleanup(self.end_client)
        wait_until(self.listed, "the job runs")

    def end_client(self):
        if self.client.poll() is None:
            self.client.send_signal(signal.SIGINT)
            finish(self.client)

    def listed(self):
        return self.run_json("jobs", "car1")["jobs"]

    def test_of_one_node(self):
        (job,) = self.listed()
        self.assertEqual((job["verb"], job["task"], job["state"]), ("DELEGATE", "sleep", "running"))
        self.assertGreater(job["deadline_ms"], 0)
        header, row = self.run_ok("jobs", self.node.url, "-o", "table").splitlines()
        self.assertEqual(header.split(), ["JOB", "STATE", "VERB", "TASK", "REQUESTER", "AGE", "LEFT", "PROGRESS"])
        self.assertRegex(row, rf"^ *{job['job']}  running  DELEGATE  sleep  tcp://127\.0\.0\.1:\d+  \d.* (min|s|ms) ")

    def test_of_all_nodes(self):
        (node,) = self.run_json("jobs")["nodes"]
        self.assertEqual((node["node"], [job["task"] for job in node["jobs"]]), ("car1", ["sleep"]))
        header, row = self.run_ok("jobs", "-o", "table").splitlines()
        self.assertEqual(header.split()[:2], ["NODE", "JOB"])
        self.assertTrue(row.startswith("car1  "), row)

    def test_one_is_cancelled(self):
        (job,) = self.listed()
        self.assertEqual(self.run_ok("jobs", "car1", "--cancel", str(job["job"])), "")
        code, out, err = finish(self.client)
        self.assertEqual((code, out, err), (5, "", "cles: cancelled: car1: the job was cancelled on this host\n"))
        code, out, err = self.run_at("jobs", "car1", "--cancel", str(job["job"]))
        self.assertEqual((code, out), (3, ""))
        self.assertTrue(err.startswith(f"cles: no_task: car1 has no job {job['job']}\n"), err)

    def test_progress(self):
        working = start("delegate", "car1:sleep/3000", "--at", self.node.url)
        wait_until(lambda: any("progress" in job for job in self.listed()), "it has made progress")
        self.assertEqual(finish(working)[0], 0)


class Times(NodeTest):
    def test_each_task_has_its_own(self):
        for _ in range(2):
            self.run_ok("delegate", "car1:sleep/1")
        (node,) = json.loads(self.run_ok("top", "-n", "1", "-o", "json"))["nodes"]
        times = {(each["verb"], each["task"]): each for each in node["tasks"]}
        self.assertEqual(times["DELEGATE", "sleep"]["samples"], 2)
        self.assertGreaterEqual(times["DELEGATE", "sleep"]["p99_us"], 1000)
        shown = self.run_ok("top", "-n", "1", "-o", "table", "--tasks").split("\n\n")[1]
        header, *rows = shown.splitlines()
        self.assertEqual(header.split(), ["NODE", "VERB", "TASK", "SAMPLES", "P50", "P99"])
        self.assertRegex(rows[0], r"^car1  DELEGATE  sleep +2 +\d")


class Others(unittest.TestCase):
    def test_a_node_that_lists_none(self):
        with ScriptedNode(lambda line, send: send(id_of(line) + '{"error":"no_task","message":"no such"}')) as node:
            code, out, err = cles("jobs", "car9", "--at", node.url)
        self.assertEqual((code, out), (3, ""))
        self.assertIn("cles: no_task: no such\n", err)

    def test_arguments(self):
        for arguments, says in ((("--cancel", "7", "--at", "tcp://127.0.0.1:1"), "needs the node"), (("all",), "all nodes"),
                                (("car1", "--cancel", "x"), "--cancel"), (("a b",), "neither")):
            code, out, err = cles("jobs", *arguments)
            self.assertEqual((code, out), (2, ""), (arguments, err))
            self.assertIn(says, err, arguments)


@unittest.skipUnless(HAS_SECURITY, "cles was built without libsodium")
class Secured(unittest.TestCase):
    def test_a_right_permits_it(self):
        with tempfile.TemporaryDirectory() as folder:
            fleet = os.path.join(folder, "fleet")
            self.assertEqual(cles("fleet", "init", fleet, "--with", "car1,car2,car3")[0], 0)
            for member, rights in (("car2", ("--may", "delegate *:sleep/*", "--may", "pull *:cles/**")),
                                   ("car3", ("--may", "pull *:cles/**", "--may", "push *:cles/jobs/*/cancel"))):
                code, _, err = cles("fleet", "rights", member, *rights, "--keys", fleet)
                self.assertEqual(code, 0, err)
            code, _, err = cles("keys", "join", f"{fleet}/roster", "--keys", f"{fleet}/car1")
            self.assertEqual(code, 0, err)
            node = start("serve", "--keys", f"{fleet}/car1", "--listen", "tls://127.0.0.1:0")
            self.addCleanup(lambda: (node.terminate(), finish(node)))
            url = read_line(node).split()[-1]

            def run(member, *arguments):
                return cles(*arguments, "--at", url, "--keys", f"{fleet}/{member}")

            client = start("delegate", "car1:sleep/60000", "-t", "1min", "--at", url, "--keys", f"{fleet}/car2")
            wait_until(lambda: json.loads(run("car3", "jobs", "car1")[1])["jobs"], "the job runs")
            (job,) = json.loads(run("car3", "jobs", "car1")[1])["jobs"]
            self.assertEqual(job["requester"], "car2")
            code, _, err = run("car2", "jobs", "car1", "--cancel", str(job["job"]))
            self.assertEqual(code, 5)
            self.assertIn("denied", err)
            self.assertEqual(run("car3", "jobs", "car1", "--cancel", str(job["job"])), (0, "", ""))
            code, _, err = finish(client)
            self.assertEqual((code, err), (5, "cles: cancelled: car1: the job was cancelled by car3\n"))


if __name__ == "__main__":
    unittest.main()
