#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The page of the gateway: what is served, and, where Node is installed, what the page decides."""

import os
import re
import shutil
import subprocess
import unittest

from gateway_support import Gateway
from support import PATIENCE, Node

DECISIONS = os.environ.get("CLES_PAGE_DECISIONS", "")  # the bundled tests; empty: built without the dashboard
KIB = 1024
# Each asset, its type, and the most bytes that it may have.
ASSETS = {
    "/app.js": ("text/javascript; charset=utf-8", 250 * KIB),
    "/app.css": ("text/css; charset=utf-8", 16 * KIB),
    "/icon.svg": ("image/svg+xml", 2 * KIB),
    "/licences.txt": ("text/plain; charset=utf-8", 32 * KIB),
}
# Names of kinds of elements, which nothing is fetched from.
NAMESPACES = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}


class Serving(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.gateway = Gateway()
        cls.page = cls.gateway.get("/")

    @classmethod
    def tearDownClass(cls):
        if cls.gateway.stop() != 0:
            raise AssertionError("the gateway did not end well")


class Page(Serving):
    def policy(self, reply):
        return dict(part.split(" ", 1) for part in reply.headers["Content-Security-Policy"].split("; "))

    def test_the_policy_permits_the_gateway_alone(self):
        own = {"script-src", "style-src", "img-src", "connect-src"}
        none = {"default-src", "base-uri", "form-action", "frame-ancestors"}
        for path in ["/", *(ASSETS if DECISIONS else []), "/session", "/nothing"]:
            policy = self.policy(self.gateway.get(path))
            self.assertEqual(policy, {**{name: "'self'" for name in own}, **{name: "'none'" for name in none}}, path)

    def test_nothing_in_the_page_is_inline(self):
        self.assertEqual(self.page.status, 200)
        self.assertEqual(self.page.headers["Content-Type"], "text/html; charset=utf-8")
        self.assertIsNone(re.search(r"<style|<script(?! src=)|\son\w+=|\sstyle=|javascript:", self.page.body))


if DECISIONS:

    class Assets(Serving):
        def test_the_assets(self):
            for path, (kind, most) in ASSETS.items():
                reply = self.gateway.get(path)
                self.assertEqual((reply.status, reply.headers["Content-Type"]), (200, kind), path)
                self.assertTrue(100 < len(reply.body.encode()) <= most, f"{path}: {len(reply.body)} bytes")
            named = set(re.findall(r'(?:src|href)="([^"]*)"', self.page.body))
            self.assertTrue({"/app.js", "/app.css", "/icon.svg"} <= named, named)

        def test_they_name_no_other_host(self):
            for path in ("/", "/app.js", "/app.css", "/icon.svg"):
                body = self.gateway.get(path).body
                self.assertEqual(set(re.findall(r"(?:https?|wss?)://[^\s\"'`)>]+", body)) - NAMESPACES, set(), path)
                self.assertEqual(re.findall(r"""["'(=]//[a-z0-9]""", body), [], path)
            self.assertNotIn("@import", self.gateway.get("/app.css").body)

        def test_nothing_is_compiled_from_text(self):
            self.assertIsNone(re.search(r"\beval\(|new Function|\bimport\(", self.gateway.get("/app.js").body))

        def test_the_licences_go_with_the_copies(self):
            text = self.gateway.get("/licences.txt").body
            for part in ("Jason Miller", "Dan Vanderkam", "The above copyright notice and this permission notice shall be"):
                self.assertIn(part, text)

    class Decisions(unittest.TestCase):
        @unittest.skipUnless(shutil.which("node"), "Node is not installed")
        def test_what_the_page_decides(self):
            done = subprocess.run(["node", DECISIONS], capture_output=True, text=True, timeout=PATIENCE, check=False)
            self.assertEqual(done.returncode, 0, done.stdout)
            self.assertRegex(done.stdout, r"[1-9]\d* cases, 0 failed")

else:

    class Without(Serving):
        def test_it_says_what_to_install(self):
            for package in ("esbuild", "node-preact", "libjs-dygraphs"):
                self.assertIn(package, self.page.body)
            self.assertEqual(self.gateway.get("/app.js").status, 404)


if __name__ == "__main__":
    unittest.main()
