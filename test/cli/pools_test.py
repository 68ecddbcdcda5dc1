#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Nodes of named pools: --pool selects them, and commands show which pool they are of."""

import json
import unittest

from support import Node, cles, environment, free_port, wait_until


class Pools(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.group = f"lo,239.255.25.37:{free_port()}"
        cls.env = environment(CLES_MULTICAST=cls.group)
        cls.node = Node("--name", "car1", "--pool", "north", "--multicast", cls.group)

    @classmethod
    def tearDownClass(cls):
        cls.node.stop()

    def nodes(self, *arguments, **more):
        code, out, err = cles("ls", "-o", "json", *arguments, env={**self.env, **more})
        self.assertEqual(code, 0, err)
        return [(node["node"], node.get("pool")) for node in json.loads(out)["peers"]]

    def test_a_pool_is_selected(self):
        wait_until(lambda: self.nodes("--pool", "north") == [("car1", "north")], "it is heard")
        self.assertEqual(self.nodes(CLES_POOL="north"), [("car1", "north")])
        self.assertEqual(self.nodes("--pool", "south", CLES_POOL="north"), [])
        code, out, err = cles("pull", "car1:echo", "--pool", "north", env=self.env)
        self.assertEqual((code, out), (0, '{"parameters":[]}\n'), err)

    def test_others_are_noticed(self):
        wait_until(lambda: "--pool NAME selects a pool" in cles("ls", "-w", "1s", env=self.env)[2], "it is heard")

    def test_the_pool_of_a_node_is_shown(self):
        self.assertEqual(self.nodes("--at", self.node.url), [("car1", "north")])
        header = cles("ls", "--at", self.node.url, "-o", "table", env=self.env)[1].splitlines()[0]
        self.assertIn("POOL", header.split())
        out = cles("info", "--at", self.node.url, "-o", "table", env=self.env)[1]
        self.assertRegex(out, r"(?m)^pool       north$")


if __name__ == "__main__":
    unittest.main()
