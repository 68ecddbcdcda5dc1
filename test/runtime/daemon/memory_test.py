#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""What idle links cost clesd after they have carried large messages: its resident memory."""

import re
import unittest

from daemon import DEFAULTS, Daemon
from fleet import COUNTING
from support import wait_until

LINKS = 64
MOST = 64  # KiB for each link
LARGE = '{"x":"' + 1_000_000 * "x" + '"}'


def resident(daemon):
    """KiB, without the pages of files."""
    with open(f"/proc/{daemon.process.pid}/smaps_rollup", encoding="ascii") as file:
        return int(re.search(r"^Anonymous:\s+(\d+) kB$", file.read(), re.MULTILINE)[1])


class IdleLinks(unittest.TestCase):
    def test_large_jobs_leave_little(self):
        plugin = f"plugins: [{{path: {COUNTING}, config: {{marks: /dev/null}}}}]\n"
        # Of the heap of a worker's thread, the C library keeps a part, however many links there are.
        with Daemon(plugin, base=DEFAULTS.replace("workers: 2", "workers: 1")) as d:
            links = [d.connect() for _ in range(LINKS)]
            try:
                for link in links:
                    self.assertIn('"sat1"', link.ask("PULL self:cles"))
                before = resident(d)
                for link in links:
                    self.assertEqual(link.ask(f"DELEGATE sat1:returns id=1 {LARGE}"), f"id=1 {LARGE}")
                left = resident(d)

                def is_returned():
                    nonlocal left
                    left = resident(d)
                    return left - before <= LINKS * MOST

                try:
                    wait_until(is_returned, "it returns memory")
                finally:
                    print(f"KiB for each idle link: {(left - before) / LINKS:.1f}")
                for link in links:
                    self.assertIn('"sat1"', link.ask("PULL self:cles"))
            finally:
                for link in links:
                    link.close()


if __name__ == "__main__":
    unittest.main()
