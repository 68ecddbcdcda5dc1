#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""`cles context`: options that are saved, and which of them commands use."""

import json
import os
import tempfile
import unittest

from support import NodeTest, cles, environment

ECHO = (0, '{"parameters":[]}\n', "")


class Contexts(NodeTest):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.env = environment(XDG_CONFIG_HOME=self.folder)
        del self.env["CLES_CONTEXT"]

    def run_in(self, *arguments, **more):
        return cles(*arguments, env={**self.env, **more})

    def save(self, *arguments):
        self.assertEqual(self.run_in("context", "save", *arguments), (0, "", ""))

    def use(self, *name):
        self.assertEqual(self.run_in("context", "use", *name), (0, "", ""))

    def listed(self, **more):
        return json.loads(self.run_in("context", "list", **more)[1])

    def test_one_is_saved_and_used(self):
        self.assertEqual(self.listed(), {"used": "", "contexts": {}})
        self.save("lab", "--at", self.node.url, "--multicast", "lo", "--pool", "north")
        self.use("lab")
        self.assertEqual(self.run_in("pull", "car1:echo"), ECHO)
        self.assertEqual(self.run_in("pull", "self:echo"), ECHO)
        listed = self.listed()
        self.assertEqual(listed["used"], "lab")
        self.assertEqual((listed["contexts"]["lab"]["at"], listed["contexts"]["lab"]["pool"]), (self.node.url, "north"))
        header, row = self.run_in("context", "list", "-o", "table")[1].splitlines()
        self.assertEqual(header.split(), ["USED", "CONTEXT", "AT", "PEERS", "KEYS", "MULTICAST", "POOL"])
        self.assertEqual(row.split(), ["*", "lab", self.node.url, "lo", "north"])
        self.use()
        self.assertEqual(self.listed()["used"], "")

    def test_peers(self):
        self.save("lab", "-p", f"car1={self.node.url}", "-p", "car2=tcp://127.0.0.1:1")
        self.use("lab")
        self.assertEqual(self.run_in("pull", "car1:echo"), ECHO)
        self.assertEqual(self.run_in("pull", "car2:echo")[0], 1)
        self.assertEqual(self.run_in("pull", "car1:echo", "--at", "tcp://127.0.0.1:1")[0], 1)  # no address of the context

    def test_options_and_variables_take_precedence(self):
        self.save("bad", "--at", "tcp://127.0.0.1:1")
        self.save("lab", "--at", self.node.url)
        self.use("bad")
        self.assertEqual(self.run_in("pull", "car1:echo")[0], 1)
        self.assertEqual(self.run_in("pull", "car1:echo", "--at", self.node.url), ECHO)
        self.assertEqual(self.run_in("ping", self.node.url, "-n", "1")[0], 0)
        self.assertEqual(self.run_in("pull", "car1:echo", CLES_AT=self.node.url), ECHO)
        self.assertEqual(self.run_in("pull", "car1:echo", CLES_CONTEXT="lab"), ECHO)
        self.assertEqual(self.listed(CLES_CONTEXT="lab")["used"], "lab")
        self.assertEqual(self.run_in("pull", "car1:echo", "--at", self.node.url, CLES_CONTEXT=""), ECHO)

    def test_what_is_saved_is_replaced(self):
        self.save("lab", "--at", "tcp://127.0.0.1:1", "--pool", "north")
        self.save("lab", "--at", self.node.url)
        self.assertEqual(self.listed()["contexts"]["lab"]["pool"], "")

    def test_what_is_saved_depends_on_no_other(self):
        self.save("lab", "--at", self.node.url)
        self.save("fleet", "--keys", "somewhere/car1")
        self.use("fleet")
        self.save("second", "--at", self.node.url)  # tcp:// is refused with keys
        code, _, err = self.run_in("context", "save", "third", "--at", "tls://127.0.0.1")
        self.assertEqual(code, 2)
        self.assertIn("needs the key of a member", err)
        for variables in ({"CLES_CONTEXT": "fourth"}, {"CLES_AT": "nowhere"}):
            saved = self.run_in("context", "save", "fourth", "--pool", "north", **variables)
            self.assertEqual(saved, (0, "", ""), variables)
        self.assertEqual(self.listed()["contexts"]["fourth"]["at"], "")

    def test_a_file_that_cannot_be_read_is_not_replaced(self):
        self.save("lab", "--at", self.node.url)
        file = os.path.join(self.folder, "cles", "contexts.json")
        os.remove(file)
        # A link to itself cannot be opened, not even by root, and whoever replaces a file replaces it.
        os.symlink(file, file)
        for arguments in (("save", "x", "--pool", "north"), ("list",)):
            code, _, err = self.run_in("context", *arguments)
            self.assertEqual(code, 2, arguments)
            self.assertIn("cannot be read", err)
        self.assertEqual(os.readlink(file), file)

    def test_keys_are_found_in_any_folder(self):
        self.save("fleet", "--keys", "somewhere/car1")
        self.assertEqual(self.listed()["contexts"]["fleet"]["keys"], os.path.abspath("somewhere/car1"))

    def test_completion(self):
        self.save("lab", "--at", self.node.url)
        self.save("fleet", "--pool", "north")
        names = [line.split("\t")[0] for line in self.run_in("__complete", "context", "use", "")[1].splitlines()]
        self.assertEqual(names, ["fleet", "lab"])

    def test_what_is_wrong(self):
        self.save("lab", "--at", self.node.url)
        for arguments, says in ((("save", "a b", "--at", "tcp://127.0.0.1"), "the name of a context"),
                                (("save", "x"), "what is to be saved"), (("save", "x", "--at", "nowhere"), "nowhere"),
                                (("use", "y"), "there is no context 'y'"), ((), "subcommand")):
            code, out, err = self.run_in("context", *arguments)
            self.assertEqual((code, out), (2, ""), (arguments, err))
            self.assertIn(says, err, arguments)
        code, _, err = self.run_in("pull", "car1:echo", CLES_CONTEXT="y")
        self.assertEqual(code, 2)
        self.assertIn("CLES_CONTEXT 'y': there is no such context", err)
        with open(os.path.join(self.folder, "cles", "contexts.json"), "w", encoding="utf-8") as file:
            file.write('{"used":7}')
        for arguments in (("pull", "car1:echo"), ("context", "list")):
            code, _, err = self.run_in(*arguments)
            self.assertEqual(code, 2, arguments)
            self.assertIn("cannot be read: used: ", err)
        self.assertEqual(self.run_in("pull", "car1:echo", "--at", self.node.url, CLES_CONTEXT=""), ECHO)


if __name__ == "__main__":
    unittest.main()
