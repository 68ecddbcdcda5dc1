# SPDX-License-Identifier: BSL-1.0
"""Shared by the tests of federation: a NATS server, and daemons that are bridges of their pools."""

import json
import unittest

from daemon import DEFAULTS, PLUGINS, Daemon, Folder
from fleet import COUNTING
from nats import NatsServer
from support import cles, wait_until


def pool_of(daemon):
    """What it says of its bridge; `pools`: how many others can be reached."""
    found = json.loads(daemon.ask("PULL self:cles/metrics"))["federation"]
    return {**found, "pools": sum(pool["state"] == "live" for pool in found.get("pools", []))}


class BridgesTest(unittest.TestCase):
    def setUp(self):
        self.folder = Folder()
        self.addCleanup(self.folder.__exit__)
        self.marks = self.folder.write("", "marks")

    def server(self, more=""):
        server = NatsServer(more)
        self.addCleanup(server.__exit__)
        return server

    def node(self, name, pool, server, more="", federation="", has_work=True, url=None, env=None):
        """A daemon with the tasks of the plugin system, and usually of primes and counting, which is a bridge if there
        is a server."""
        work = f", {PLUGINS}/libcles-primes.so, {{path: {COUNTING}, config: {{marks: {self.marks}}}}}" if has_work else ""
        plugins = f"plugins: [{PLUGINS}/libcles-system.so{work}]\n"
        bridge = f"insecure: true\nfederation: {{nats: '{url or server.url}', pool: {pool}{federation}}}\n" if server else f"pool: {pool}\n"
        node = Daemon(plugins + bridge + "drain: 300ms\n" + more, base=DEFAULTS.replace("sat1", name), env=env)
        self.addCleanup(node.__exit__)
        return node

    def wait_for_pools(self, *nodes):
        for node in nodes:
            wait_until(lambda node=node: pool_of(node)["pools"] == len({id(n) for n in nodes}) - 1, "pools are known")

    def diagnosis(self, node):
        """What `cles doctor` finds about the node's connection to NATS, as verdict and text."""
        _, out, _ = cles("doctor", "--at", node.url, "-o", "json")
        return [(each["verdict"], each["text"]) for each in json.loads(out)["findings"] if each["check"] == "federation"]
