#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""access_table.json is what access_oracle.py decides, and covers every reason to decide so."""

import json
import unittest
from collections import Counter
from pathlib import Path

import access_oracle as oracle

TABLE = json.loads((Path(__file__).resolve().parent / "access_table.json").read_text())


class AccessTable(unittest.TestCase):
    def test_it_is_up_to_date(self):
        for scenario in TABLE:
            self.assertEqual(scenario["rows"], oracle.rows_of(scenario), "run make_access_table.py")

    def test_it_has_many_cells_of_each_kind(self):
        cells = Counter(letter for scenario in TABLE for row in scenario["rows"].values() for letter in row)
        self.assertEqual(set(cells), set("PXRTWNUDMO"))
        self.assertGreater(min(cells.values()), 300)


if __name__ == "__main__":
    unittest.main()
