#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles trace` among daemons: over several links, with jobs that wait, and jobs that move; and the trace in their logs."""

import json
import unittest

from daemon import DEFAULTS, STUBBORN, Daemon, Folder, body, wait_until_running
from fleet import Fleet
from load import Load
from routes_test import Loopback, Network
from support import PATIENCE, cles, finish, start, wait_until

TRACE = "4bf92f3577b34da6a3ce929d0e0e4736"
ADVERB = f"trace=00-{TRACE}-00f067aa0ba902b7-01"


def path_of(hop):
    """The nodes on the way, from the first to the last; each sent to one other."""
    names = [hop["node"]]
    while hop["hops"]:
        (hop,) = hop["hops"]
        names.append(hop["node"])
    return names


def last_of(hop):
    while hop["hops"]:
        hop = hop["hops"][-1]
    return hop


class TraceTest(unittest.TestCase):
    def trace(self, *arguments, code=0):
        ended, out, err = cles("trace", *arguments, "-o", "json")
        self.assertEqual(ended, code, err)
        return json.loads(out)

    def entries_with(self, daemon, trace):
        return [entry for entry in daemon.entries() if entry.get("trace") == trace]


class Line(Network, TraceTest):
    """Four daemons, each of which has links to its neighbours only."""

    NAMES = ["n1", "n2", "n3", "n4"]
    CABLES = list(zip(NAMES, NAMES[1:]))
    NEAR, FAR = "n1", "n4"
    NETWORK = Loopback
    HAS_LINKS = True

    def url(self, name):
        return self.network.url(name, None)

    def test_each_node_on_the_way_is_a_hop(self):
        found = self.trace("pull", "n4:prime/7", "--at", self.url("n1"))
        self.assertEqual(found["outcome"], "ok")
        self.assertEqual(path_of(found["request"]), ["cles", "n1", "n2", "n3", "n4"])
        hop, totals = found["request"], []
        while hop["hops"]:
            totals.append(hop["total_us"])
            (inner,) = hop["hops"]
            self.assertEqual(inner["outcome"], "ok")
            self.assertEqual(inner["request"], "PULL prime")
            # What it took longer for the sender; both are durations of one clock each.
            self.assertGreaterEqual(inner["link_us"], 0)
            self.assertLessEqual(inner["total_us"], hop["total_us"])
            hop = inner
        self.assertGreater(hop["run_us"], 0)
        self.assertLessEqual(hop["run_us"] + hop["queue_us"], hop["total_us"] + 1)
        for forwarding in (found["request"]["hops"][0], found["request"]["hops"][0]["hops"][0]):
            self.assertEqual(forwarding["run_us"], 0)

    def test_a_failure_is_shown_and_reported(self):
        code, out, err = cles("trace", "pull", "n4:nothing", "--at", self.url("n1"))
        self.assertEqual(code, 3)
        self.assertIn("no_task", err)
        lines = out.splitlines()
        self.assertEqual(len(lines), 2 + 5, out)
        for line in lines[2:]:
            self.assertTrue(line.endswith(" no_task"), out)

    def test_all(self):
        found = self.trace("pull", "all:prime/7", "--at", self.url("n2"))
        (asked,) = found["request"]["hops"]
        self.assertEqual(asked["node"], "n2")
        reached = {last_of(hop)["node"] for hop in asked["hops"]}
        self.assertEqual(reached, {"n1", "n3", "n4"})
        self.assertGreater(asked["run_us"], 0)  # it is one of them
        (far,) = [hop for hop in asked["hops"] if hop["node"] == "n3" and hop["hops"]]
        self.assertEqual(path_of(far), ["n3", "n4"])

    def test_the_log_bears_the_trace_where_the_job_runs(self):
        near, far = self.nodes["n1"], self.nodes["n4"]
        job = start("trace", "delegate", f"n4:waits/{self.quoted(far.file('go'))}", "--at", self.url("n1"), "-o", "json")
        entry = far.wait_for_entry("waiting")
        far.write("", "go")
        code, out, err = finish(job)
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(entry["trace"], json.loads(out)["trace"])
        self.assertEqual(self.entries_with(near, entry["trace"]), [])

    @staticmethod
    def quoted(path):
        return path.replace("/", "%2F")

    def test_the_spans_of_each_node(self):
        with self.nodes["n1"].connect() as link:
            link.ask(f"PULL n3:prime/7 {ADVERB}")
            names = {}
            for name in self.NAMES:
                reply = json.loads(link.ask(f"PULL {name}:cles/trace/{TRACE}"))
                self.assertEqual(reply["node"], name)
                names[name] = [(span["kind"], span["target"], span.get("next")) for span in reply["spans"]]
            self.assertEqual(names, {"n1": [("received", "n3", None), ("sent", "n3", "n2")],
                                     "n2": [("received", "n3", None), ("sent", "n3", None)],
                                     "n3": [("received", "n3", None)], "n4": []})
            gathered = json.loads(link.ask(f"PULL all:cles/trace/{TRACE}"))
            self.assertEqual({name: len(each["spans"]) for name, each in gathered["results"].items()},
                             {"n1": 2, "n2": 2, "n3": 1, "n4": 0})


class Moved(TraceTest):
    def test_a_job_that_moves_is_a_hop(self):
        with Fleet(2) as fleet, Load(fleet["sat1"], fleet.names) as load:
            held = [load.send("sat1", "holds", deadline=60) for _ in range(2)]
            wait_until(lambda: len(fleet.marks()) == 2, "all workers of sat1 are held")
            self.assertEqual(sum(fleet.marks().values(), []), ["sat1", "sat1"])
            found = self.trace("delegate", "sat1:once/77/20", "--at", fleet["sat1"].url)
            self.assertEqual(path_of(found["request"]), ["cles", "sat1", "sat2"])
            (here,) = found["request"]["hops"]
            (there,) = here["hops"]
            self.assertGreater(here["queue_us"], 0)
            self.assertEqual(here["run_us"], 0)
            self.assertGreaterEqual(there["run_us"], 20_000)
            self.assertEqual(fleet.marks()[77], ["sat2"])
            for job in held:
                load.write([f"PUSH self:cles/cancel/{job.number} reply=no\n"])
            load.wait_until(lambda: all(job.ended for job in held), "they have ended")
            self.assertEqual(fleet.stop(), [0, 0])


class Jobs(TraceTest):
    """One daemon with one worker."""

    ISOLATION = ""

    def setUp(self):
        self.folder = Folder()
        self.addCleanup(self.folder.__exit__)
        self.daemon = Daemon(f"plugins:\n  - path: {STUBBORN}\n{self.ISOLATION.format(self.folder.path)}",
                             base=DEFAULTS.replace("workers: 2", "workers: 1"))
        self.addCleanup(self.daemon.__exit__)

    def hold_the_worker(self):
        self.held = self.daemon.connect()
        self.addCleanup(self.held.close)
        self.held.send(f"DELEGATE self:waits/{self.folder.file('go').replace('/', '%2F')} deadline={int(PATIENCE * 1000)}")
        wait_until_running(self.daemon, 1)

    def release(self):
        self.folder.write("", "go")
        self.assertEqual(body(self.held.read()), {"value": "found"})

    def test_the_time_in_the_queue(self):
        self.hold_the_worker()
        job = start("trace", "pull", "self:quick", "--at", self.daemon.url, "-t", f"{PATIENCE}s", "-o", "json")
        wait_until(lambda: json.loads(self.daemon.ask("PULL self:cles/metrics"))["pool"]["queued"] == 1, "it waits")
        self.release()
        code, out, err = finish(job)
        self.assertEqual((code, err), (0, ""))
        (hop,) = json.loads(out)["request"]["hops"]
        self.assertGreater(hop["queue_us"], hop["run_us"])
        self.assertGreater(hop["run_us"], 0)
        self.assertLessEqual(hop["queue_us"] + hop["run_us"], hop["total_us"])

    def test_a_job_whose_time_passes_in_the_queue(self):
        self.hold_the_worker()
        found = self.trace("pull", "self:quick", "--at", self.daemon.url, "-t", "200ms", code=4)
        self.assertEqual(found["outcome"], "deadline")
        self.release()
        with self.daemon.connect() as link:
            (span,) = json.loads(link.ask(f"PULL self:cles/trace/{found['trace']}"))["spans"]
        self.assertIn(span["outcome"], ("deadline", "cancelled"))
        self.assertGreater(span["queue_us"], 100_000)
        self.assertEqual(span["run_us"], 0)

    def test_the_log_of_the_plugin(self):
        self.assertEqual(body(self.daemon.ask(f"DELEGATE self:twice {ADVERB}")), {"value": 1})
        entry = self.daemon.wait_for_entry("answered a job that does not exist")
        self.assertEqual(entry["trace"], TRACE)
        self.folder.write("", "go")
        self.daemon.ask(f"DELEGATE self:waits/{self.folder.file('go').replace('/', '%2F')}")
        self.assertNotIn("trace", self.daemon.wait_for_entry("waiting"))
        self.assertEqual(self.daemon.stop()[0], 0)


class Isolated(Jobs):
    """The same with the plugin in a process of its own."""

    ISOLATION = "    isolation: process\n    limits: {{read: [{}]}}\n"


if __name__ == "__main__":
    unittest.main(verbosity=2)
