#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The examples run, and the types of one of them are printed as dataclasses."""

import ast
import asyncio
import csv
import io
import os
import re
import subprocess
import sys
import unittest
from pathlib import Path

import cles
from support import PATIENCE, AsyncTest

EXAMPLES = Path(__file__).parents[2] / "python" / "examples"


class Examples(AsyncTest):
    def begin(self, name, *arguments):
        """Starts one; returns the URL at which it listens."""
        process = subprocess.Popen([sys.executable, "-B", EXAMPLES / f"{name}.py", *arguments], stdout=subprocess.PIPE, text=True)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        return process.stdout.readline().split(" ")[-1].strip()

    async def run_one(self, *command, **variables):
        process = await asyncio.create_subprocess_exec(sys.executable, "-B", *command, stdout=subprocess.PIPE,
                                                       stderr=subprocess.PIPE, env={**os.environ, **variables})
        out, err = await asyncio.wait_for(process.communicate(), PATIENCE)
        self.assertEqual((process.returncode, err.decode()), (0, ""))
        return out.decode()

    async def test_a_sensor_its_log_and_its_plot(self):
        url = self.begin("publish_sensor", "tcp://127.0.0.1:0")
        log = await self.run_one(EXAMPLES / "log_to_csv.py", "thermo:temperature", "--at", url, "-n", "3")
        rows = list(csv.DictReader(io.StringIO(log)))
        self.assertEqual((len(rows), list(rows[0])), (3, ["received", "seq", "missed", "time", "celsius"]))
        self.assertTrue(all(17 < float(row["celsius"]) < 25 for row in rows))
        plot = await self.run_one(EXAMPLES / "plot_live.py", "thermo:temperature", "celsius", "--at", url, "-n", "3", COLUMNS="40",
                                  LINES="10")
        self.assertEqual(len(plot.splitlines()), 3 * 8)
        self.assertIn("thermo:temperature celsius  now ", plot)
        self.assertIn("█", plot)
        types = await self.run_one("-m", "cles", "types", "thermo", "--at", url)
        self.assertIn("@dataclass\nclass Temperature:\n", types)
        self.assertIn("celsius: Annotated[float, Field(unit='°C', minimum=-40, maximum=125)]", types)

    async def test_a_mock(self):
        url = self.begin("mock_service", "tcp://127.0.0.1:0")
        async with cles.connect(url) as node:
            told = []
            try:
                moved = await node.delegate("arm1:move", {"x": 1, "y": 2, "z": 3},
                                            progress=lambda fraction, _: told.append(fraction))
                self.assertEqual(moved, {"x": 1.0, "y": 2.0, "z": 3.0})
            except cles.Error as error:
                self.assertIn("stuck", error.message)
            self.assertEqual(len(told), 10)
            self.assertEqual(await node.pull("arm1:position"), {"x": 1.0, "y": 2.0, "z": 3.0})
            with self.assertRaisesRegex(cles.Error, "below the table"):
                await node.delegate("arm1:move", {"x": 1, "y": 2, "z": -3})

    async def test_types_of_a_node_that_is_not_there(self):
        process = await asyncio.create_subprocess_exec(sys.executable, "-B", "-m", "cles", "types", "self", "--at",
                                                       "tcp://127.0.0.1:1", stderr=subprocess.PIPE)
        _, err = await process.communicate()
        self.assertEqual(process.returncode, 1)
        self.assertTrue(err.decode().startswith("cles: unavailable: "), err)


class Page(unittest.TestCase):
    def test_its_code_compiles(self):
        pages = [EXAMPLES.parents[1] / "docs" / "python.md", EXAMPLES.parent / "README.md"]
        blocks = [block for page in pages for block in re.findall(r"^```python\n(.*?)^```$", page.read_text(encoding="utf-8"),
                                                                  re.MULTILINE | re.DOTALL)]
        self.assertGreater(len(blocks), 8)
        for block in blocks:
            compile(block, "page", "exec", flags=ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)


if __name__ == "__main__":
    unittest.main()
