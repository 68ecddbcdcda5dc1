#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Multicast while the interfaces of a host get and lose addresses, go down, and are made anew."""

import json
import re
import unittest

from support import PATIENCE, read_line, wait_until
from two_hosts import Hosts

FAR_MORE_THAN_WAIT = 20  # updates: more than wait in sockets and pipes


class InterfaceChanges(unittest.TestCase):
    """`near` has 10.77.0.1 at v0, `far` has 10.77.0.2 at v1."""

    def setUp(self):
        self.hosts = Hosts()
        self.addCleanup(self.hosts.close)
        self.near, self.far = self.hosts.near, self.hosts.far

    def start(self, host, interfaces, *arguments):
        return self.hosts.start(self, host, interfaces, *arguments)

    def run_at(self, host, interfaces, *arguments):
        process = self.start(host, interfaces, *arguments)
        out, err = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 0, err)
        return out

    def serve(self, interfaces):
        process = self.start(self.near, interfaces, "serve", "--name", "car1", "--insecure", "--listen",
                             "tcp://0.0.0.0:0")
        return process, re.search(r"tcp://\S+:(\d+)$", read_line(process)).group(1)

    def found_at_far(self):
        """The nodes that are received there, each with its endpoints."""
        return [(p["node"], p["endpoints"])
                for p in json.loads(self.run_at(self.far, "v1", "ls", "-o", "json"))["peers"]]

    def log_of(self, process):
        process.terminate()
        _, log = process.communicate(timeout=PATIENCE)
        return log

    def test_an_interface_gets_its_address_after_the_start(self):
        self.hosts.ip(self.near, "address", "flush", "dev", "v0")
        process, port = self.serve("auto")
        self.assertEqual(self.found_at_far(), [])
        self.hosts.ip(self.near, "address", "add", "10.77.0.1/24", "dev", "v0")
        wait_until(lambda: self.found_at_far() == [("car1", [f"tcp://10.77.0.1:{port}"])], "car1 is found")
        self.assertEqual(re.findall(r"has joined \S+ on (\w+)", self.log_of(process)), ["lo", "v0"])

    def test_an_address_changes(self):
        process, port = self.serve("v0")
        binder = self.start(self.far, "v1", "bind", "car1:localization", "-o", "json")
        read_line(binder)
        self.hosts.ip(self.near, "address", "flush", "dev", "v0")
        self.hosts.ip(self.near, "address", "add", "10.77.0.77/24", "dev", "v0")
        wait_until(lambda: self.found_at_far() == [("car1", [f"tcp://10.77.0.77:{port}"])], "car1 is found again")
        for _ in range(FAR_MORE_THAN_WAIT):
            read_line(binder)
        self.assertEqual(json.loads(self.run_at(self.far, "v1", "pull", "car1:cles", "-o", "json"))["node"], "car1")
        log = self.log_of(process)
        self.assertRegex(log, "has left .* on v0, which does not have 10.77.0.1 any more")
        self.assertRegex(log, "has joined .* on v0, sending from 10.77.0.77:")

    def test_an_interface_is_made_anew(self):
        process, port = self.serve("auto")
        binder = self.start(self.far, "auto", "bind", "all:localization", "-o", "json")
        read_line(binder)
        self.hosts.ip(self.near, "link", "delete", "v0")
        self.hosts.ip(self.near, "link", "add", "v0", "type", "veth", "peer", "name", "v1", "netns", str(self.far))
        for host, name, address in ((self.near, "v0", "10.77.0.1/24"), (self.far, "v1", "10.77.0.2/24")):
            self.hosts.ip(host, "address", "add", address, "dev", name)
            self.hosts.ip(host, "link", "set", name, "up")
        for _ in range(FAR_MORE_THAN_WAIT):
            read_line(binder)
        self.assertEqual(self.found_at_far(), [("car1", [f"tcp://10.77.0.1:{port}"])])
        self.assertEqual(re.findall(r"has joined \S+ on (\w+)", self.log_of(process)), ["lo", "v0", "v0"])

    def test_what_cannot_be_sent_is_counted_and_logged_once(self):
        process, port = self.serve("lo,v0")
        self.hosts.ip(self.near, "link", "set", "v0", "down")

        def failed():
            counts = json.loads(self.run_at(self.near, "off", "pull", "self:cles/metrics", "--at",
                                            f"tcp://127.0.0.1:{port}", "-o", "json"))
            return counts.get("group_failed", 0)

        wait_until(lambda: failed() > 2, "announcements cannot be sent")
        self.hosts.ip(self.near, "link", "set", "v0", "up")
        wait_until(lambda: self.found_at_far() == [("car1", [f"tcp://10.77.0.1:{port}"])], "car1 is found again")
        said = re.findall(r"cannot send to the multicast group from (\S+): ", self.log_of(process))
        self.assertEqual(said, ["10.77.0.1"])


if __name__ == "__main__":
    unittest.main()
