#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Multicast by several interfaces: two hosts with two cables; nodes of the same host are also discovered."""

import json
import re
import unittest

from support import PATIENCE, read_line, wait_until
from two_hosts import Hosts


class Interfaces(unittest.TestCase):
    """`near` has 10.77.0.1 at v0 and 10.78.0.1 at w0, `far` 10.77.0.2 at v1 and 10.78.0.2 at w1. At `near`, x0 has no
    address, y0 is down, and z0 has no link."""

    def setUp(self):
        self.hosts = Hosts()
        self.addCleanup(self.hosts.close)
        near, far = self.hosts.near, self.hosts.far
        self.hosts.ip(near, "link", "add", "w0", "type", "veth", "peer", "name", "w1", "netns", str(far))
        for host, number in ((near, 0), (far, 1)):
            self.hosts.ip(host, "address", "add", f"10.78.0.{number + 1}/24", "dev", f"w{number}")
            self.hosts.ip(host, "link", "set", f"w{number}", "up")
        for name in ("x0", "y0", "z0"):
            self.hosts.ip(near, "link", "add", name, "type", "veth", "peer", "name", name.replace("0", "9"))
        for name in ("x0", "x9", "z0"):
            self.hosts.ip(near, "link", "set", name, "up")
        self.hosts.ip(near, "address", "add", "10.79.0.1/24", "dev", "y0")
        self.hosts.ip(near, "address", "add", "10.80.0.1/24", "dev", "z0")

    def start(self, host, interfaces, *arguments):
        return self.hosts.start(self, host, interfaces, *arguments)

    def run_at(self, host, interfaces, *arguments):
        process = self.start(host, interfaces, *arguments)
        out, err = process.communicate(timeout=PATIENCE)
        return process.returncode, out, err

    def serve(self, interfaces, name, *more, listen="tcp://0.0.0.0:0"):
        process = self.start(self.hosts.near, interfaces, "serve", "--name", name, "--insecure", "--listen", listen, *more)
        return re.search(r"tcp://\S+:(\d+)$", read_line(process)).group(1)

    def found_at(self, host, interfaces):
        """The nodes that are received there, each with its first endpoint."""
        code, out, err = self.run_at(host, interfaces, "ls", "-o", "json")
        self.assertEqual((code, err), (0, ""))
        return [(p["node"], p["state"], p["endpoints"][:1]) for p in json.loads(out)["peers"]]

    def uptime_of(self, url):
        code, out, err = self.run_at(self.hosts.near, "off", "pull", "self:cles", "--at", url, "-o", "json")
        self.assertEqual((code, err), (0, ""))
        return json.loads(out)["uptime_ms"]

    def metrics_of(self, url):
        code, out, err = self.run_at(self.hosts.near, "off", "pull", "self:cles/metrics", "--at", url, "-o", "json")
        self.assertEqual((code, err), (0, ""))
        return json.loads(out)

    def test_a_node_is_found_once_by_each_who_can_reach_it(self):
        port = self.serve("lo,v0", "car1")
        near, far = self.hosts.near, self.hosts.far
        self.assertEqual(self.found_at(near, "lo"), [("car1", "live", [f"tcp://127.0.0.1:{port}"])])
        self.assertEqual(self.found_at(near, "lo,v0"), [("car1", "live", [f"tcp://127.0.0.1:{port}"])])
        self.assertEqual(self.found_at(near, "v0"), [("car1", "live", [f"tcp://10.77.0.1:{port}"])])
        self.assertEqual(self.found_at(far, "lo,v1"), [("car1", "live", [f"tcp://10.77.0.1:{port}"])])
        self.assertEqual(self.found_at(far, "v1,w1"), [("car1", "live", [f"tcp://10.77.0.1:{port}"])])
        code, out, err = self.run_at(far, "lo", "ls", "-o", "json")
        self.assertEqual((code, json.loads(out)["peers"]), (0, []))
        self.assertIn("no node has announced itself on lo;", err)

    def test_what_listens_on_loopback_alone_is_asked_by_loopback(self):
        port = self.serve("v0,lo", "car1", listen="tcp://127.0.0.1:0")
        for _ in range(5):
            self.assertEqual(self.found_at(self.hosts.near, "v0,lo"), [("car1", "live", [f"tcp://127.0.0.1:{port}"])])
        code, out, err = self.run_at(self.hosts.near, "v0,lo", "pull", "car1:echo", "-o", "json")
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(self.found_at(self.hosts.far, "v1"), [("car1", "live", [])])

    def test_automatic(self):
        port = self.serve("auto", "car1")
        near, far = self.hosts.near, self.hosts.far
        self.assertEqual(self.found_at(near, "auto"), [("car1", "live", [f"tcp://127.0.0.1:{port}"])])
        self.assertEqual(self.found_at(near, "lo"), [("car1", "live", [f"tcp://127.0.0.1:{port}"])])
        self.assertEqual(self.found_at(far, "v1"), [("car1", "live", [f"tcp://10.77.0.1:{port}"])])
        self.assertEqual(self.found_at(far, "w1"), [("car1", "live", [f"tcp://10.78.0.1:{port}"])])
        code, out, _ = self.run_at(far, "auto", "pull", "car1:cles", "-o", "json")
        self.assertEqual((code, json.loads(out)["node"]), (0, "car1"))
        code, _, err = self.run_at(near, "auto", "ls", "-vv")
        self.assertEqual(code, 0)
        self.assertEqual(re.findall(r"has joined 239.255.25.37:25370 on (\S+),", err), ["lo", "v0", "w0"])

    def test_automatic_where_there_is_none(self):
        for name in ("lo", "v1", "w1"):
            self.hosts.ip(self.hosts.far, "link", "set", name, "down")
        code, out, err = self.run_at(self.hosts.far, "auto", "serve", "--listen", "tcp://0.0.0.0:0", "--insecure")
        self.assertEqual((code, out), (1, ""))
        self.assertIn("cannot join 239.255.25.37:25370 on 'auto': no interface of this host can be used", err)

    def test_each_update_comes_once_and_one_cable_is_enough(self):
        port = self.serve("v0,w0", "car1", "--rate", "20")
        binder = self.start(self.hosts.far, "v1,w1", "bind", "all:localization", "-o", "json")
        seqs = [json.loads(read_line(binder))["seq"] for _ in range(20)]
        self.assertEqual(seqs, list(range(seqs[0], seqs[0] + 20)))
        self.hosts.ip(self.hosts.near, "link", "set", "v0", "down")
        more = [json.loads(read_line(binder))["seq"] for _ in range(20)]
        self.assertEqual(more, list(range(seqs[-1] + 1, seqs[-1] + 21)))
        asked = self.metrics_of(f"tcp://127.0.0.1:{port}")
        self.assertEqual((asked["group_leases"], asked["group_dropped"]), (2, 0))

    def test_a_node_is_asked_by_the_other_cable_when_one_is_cut(self):
        port = self.serve("v0,w0", "car1")
        watcher = self.start(self.hosts.far, "v1,w1", "serve", "--name", "watcher", "--insecure", "--listen",
                             "tcp://127.0.0.1:0")
        at = re.search(r"tcp://\S+", read_line(watcher)).group(0)

        def known():
            code, out, err = self.run_at(self.hosts.far, "off", "pull", "self:cles/peers", "--at", at, "-o", "json")
            self.assertEqual((code, err), (0, ""))
            return [(p["node"], p["state"], p["endpoints"]) for p in json.loads(out)["peers"] if p["node"] == "car1"]

        wait_until(lambda: known() and known()[0][1] == "live", "car1 is heard")
        first = known()[0][2][0]
        cable = "v0" if first.startswith("tcp://10.77.") else "w0"
        self.hosts.ip(self.hosts.near, "link", "set", cable, "down")
        other = f"tcp://10.78.0.1:{port}" if cable == "v0" else f"tcp://10.77.0.1:{port}"
        seen = set()

        def has_moved():
            ((_, state, endpoints),) = known()
            seen.add(state)
            return endpoints == [other]

        wait_until(has_moved, "car1 is asked by the other cable")
        self.assertEqual(seen, {"live"})

    def test_a_second_node_of_the_name_is_another(self):
        first = f"tcp://127.0.0.1:{self.serve('lo,v0', 'car1')}"
        watcher = self.start(self.hosts.near, "lo,v0", "serve", "--name", "watcher", "--insecure", "--listen",
                             "tcp://127.0.0.1:0")
        at = re.search(r"tcp://\S+", read_line(watcher)).group(0)
        wait_until(lambda: self.metrics_of(at)["announcements_received"] > 0, "car1 is heard")
        wait_until(lambda: self.uptime_of(first) > 1500, "car1 was there first for everybody")
        again = self.start(self.hosts.near, "lo,v0", "serve", "--name", "car1", "--insecure", "--listen",
                           "tcp://0.0.0.0:0")
        _, err = again.communicate(timeout=PATIENCE)
        self.assertEqual(again.returncode, 1, err)  # the first one has the name
        counted = self.metrics_of(at)
        self.assertEqual(counted["peers_known"], 1)
        self.assertGreater(counted["group_repeated"], 0)

    def test_what_cannot_be_is_refused(self):
        for interfaces, code, words in (
                ("lo,nowhere0", 1, "on 'nowhere0': No such device"),
                ("lo,x0", 1, "on 'x0': it has no IPv4 address"),
                ("lo,y0", 1, "on 'y0': it is down"),
                ("lo,", 2, "'lo,' has an empty name of an interface"),
                ("lo,v0,lo", 2, "'lo,v0,lo' names 'lo' twice"),
                ("lo,auto", 2, "combines 'auto' with other names"),
                ("a,b,c,d,e,f,g,h,i", 2, "names 9 interfaces: at most 8"),
        ):
            ended, out, err = self.run_at(self.hosts.near, "off", "serve", "--listen", "tcp://0.0.0.0:0", "--insecure",
                                          "-m", interfaces)
            self.assertEqual((ended, out), (code, ""), err)
            self.assertIn(words, err)
        for interfaces in ("lo,v0", "auto"):
            ended, _, err = self.run_at(self.hosts.near, interfaces, "serve", "--listen", "tcp://127.0.0.1:0")
            self.assertEqual(ended, 2)
            self.assertIn("multicast on 'v0' can be reached from other hosts", err)

    def test_doctor_looks_at_each(self):
        code, out, err = self.run_at(self.hosts.near, "lo,v0,x0", "doctor", "-o", "json")
        self.assertEqual((code, err), (1, ""))
        found = [(e["check"], e["verdict"], e["text"]) for e in json.loads(out)["findings"]]
        self.assertIn(("interfaces", "ok", "multicast uses lo, for nodes on this host"), found)
        self.assertIn(("interfaces", "ok", "multicast uses v0"), found)
        self.assertIn(("interfaces", "failure", "multicast is configured for x0, which has no IPv4 address"), found)
        for name in ("lo", "v0"):
            self.assertIn(("multicast", "ok", f"datagrams to 239.255.25.37:25370 on {name} are received"), found)
        advice = [e.get("advice", "") for e in json.loads(out)["findings"] if e["text"] == "multicast uses v0"]
        self.assertIn("CLES_MULTICAST=lo,v0,x0 (on each its own interface)", advice[0])
        code, out, _ = self.run_at(self.hosts.near, "auto", "doctor", "-o", "json")
        self.assertEqual([e["text"] for e in json.loads(out)["findings"] if e["check"] == "multicast"],
                         [f"datagrams to 239.255.25.37:25370 on {name} are received" for name in ("lo", "v0", "w0")])


if __name__ == "__main__":
    unittest.main()
