#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Runs the measurement of all peers on programs that replay what was recorded of the real ones, so that it needs none
of them installed; and checks the table and the JSON.

    peers_report_test.py FOLDER

FOLDER holds the measurement. What was recorded is in peers_recorded.jsonl beside this file.
"""

import json
import os
import stat
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

FOLDER = Path(sys.argv[1])
RECORDED = Path(__file__).with_name("peers_recorded.jsonl")
sys.path.insert(0, str(FOLDER))
import peers_rows  # noqa: E402

# Prints what was recorded of the peer with its name, for the arguments with which it was recorded. It is a shell script
# because it is started often, and a shell starts quickly.
REPLAY = """#!/bin/sh
peer=${0##*/cles_peer_}
if [ "$1" = --about ]; then
    echo '{"peer": "'"$peer"'", "version": "7", "carriers": "tcp", "settings": "as recorded"}'
elif [ "$peer" = "$FAILING_PEER" ]; then
    echo "cles_peer: its server is gone" >&2
    exit 1
elif [ -f "${0%/*}/recorded/$peer ${*%% --count*}" ]; then
    cat "${0%/*}/recorded/$peer ${*%% --count*}"
else
    echo "cles_peer: not offered: nothing was recorded of this" >&2
    exit 77
fi
"""


# Runs a script without looking for other work on the machine for a second first.
AT_ONCE = """
import os, runpy, sys
del sys.argv[0]
sys.path.insert(0, os.path.dirname(sys.argv[0]))
import provenance
provenance.busy_cores = lambda: 0.0
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def recorded():
    return [json.loads(line) for line in RECORDED.read_text(encoding="utf-8").splitlines()]


def arguments_of(run):
    many = {"in_flight": "--in-flight", "subscribers": "--subscribers"}
    told = [f"{option} {run[key]}" for key, option in many.items() if key in run and (key, run[key]) != ("in_flight", 1)]
    return " ".join([f"--mode {run['mode']}", *told, f"--over {run['over']}"])


def find(peer, over, mode, **more):
    return next(run for run in recorded() if (run["peer"], run["over"], run["mode"]) == (peer, over, mode)
                and all(run[key] == value for key, value in more.items()))


class Report(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.programs = Path(scratch.name)
        self.output = self.programs / "peers.json"
        (self.programs / "skipped.json").write_text('{"grpc": "libgrpc++-dev is not installed"}\n', encoding="utf-8")

        (self.programs / "recorded").mkdir()
        for run in recorded():
            (self.programs / "recorded" / f"{run['peer']} {arguments_of(run)}").write_text(json.dumps(run),
                                                                                           encoding="utf-8")

    def install(self, *names):
        for name in names:
            program = self.programs / f"cles_peer_{name}"
            program.write_text(REPLAY, encoding="utf-8")
            program.chmod(program.stat().st_mode | stat.S_IXUSR)

    def run_peers(self, *arguments, **environment):
        return subprocess.run([sys.executable, "-B", "-c", AT_ONCE, str(FOLDER / "peers.py"), "--programs", str(self.programs),
                               "-o", str(self.output), *arguments], capture_output=True, text=True, check=False,
                              env={**os.environ, **environment}, timeout=120)

    def result(self):
        return json.loads(self.output.read_text(encoding="utf-8"))

    def test_what_was_recorded_becomes_rows_and_ratios(self):
        self.install("by_hand", "zeromq")
        done = self.run_peers("--rounds", "2")
        self.assertEqual(done.returncode, 0, done.stderr)
        result = self.result()
        self.assertEqual([row["name"] for row in result["rows"]],
                         ["by_hand tcp", "by_hand unix", "by_hand multicast", "zeromq tcp", "zeromq unix"])
        for key in ("title", "command", "machine", "date"):
            self.assertTrue(result[key], key)
        rows = {row["name"]: row for row in result["rows"]}
        zeromq, by_hand = rows["zeromq tcp"], rows["by_hand tcp"]
        self.assertEqual(by_hand["ratios"]["p50"], 1)
        theirs, ours = find("zeromq", "tcp", "exchange", in_flight=1), find("by_hand", "tcp", "exchange", in_flight=1)
        self.assertAlmostEqual(zeromq["ratios"]["p50"], theirs["p50_us"] / ours["p50_us"])
        self.assertAlmostEqual(zeromq["ratios"]["CPU"], theirs["cpu_us"] / ours["cpu_us"])
        self.assertEqual(zeromq["measures"]["exchange"]["p50_us"]["runs"], 2)
        self.assertEqual(zeromq["memory_kib"], sum(theirs["memory_kib"].values()))
        self.assertEqual(zeromq["library_bytes"], sum(theirs["libraries"].values()))
        self.assertGreater(zeromq["library_bytes"], by_hand["library_bytes"])
        crowd = find("zeromq", "tcp", "exchange", in_flight=64)["per_s"]
        self.assertAlmostEqual(zeromq["ratios"]["64 in flight"],
                               crowd / find("by_hand", "tcp", "exchange", in_flight=64)["per_s"])

    def test_what_a_carrier_does_not_offer_is_said_and_not_counted(self):
        self.install("by_hand")
        done = self.run_peers("--rounds", "1", "-o", "-")  # and no table
        self.assertEqual(done.returncode, 0)
        multicast = next(row for row in json.loads(done.stdout)["rows"] if row["over"] == "multicast")
        self.assertIn("exchange", multicast["not_offered"])
        self.assertIn("fan_out_8", multicast["measures"])
        self.assertIsNone(multicast["ratios"]["p50"])
        self.assertIsNone(multicast["memory_kib"])

    def test_missing_peers_are_skipped_by_name_with_the_reason(self):
        self.install("by_hand")
        done = self.run_peers("--rounds", "1")
        self.assertEqual(done.returncode, 0, done.stderr)
        skipped = {each["name"]: each["reason"] for each in self.result()["skipped"]}
        self.assertEqual(set(skipped), {peer for peer, _ in peers_rows.PEERS} - {"by_hand"})
        self.assertEqual(skipped["grpc"], "libgrpc++-dev is not installed")
        self.assertEqual(skipped["nng"], "its program is not built")
        self.assertIn("without grpc: libgrpc++-dev is not installed", done.stdout)

    def test_a_peer_that_fails_is_named_and_the_others_go_on(self):
        self.install("by_hand", "zeromq")
        done = self.run_peers("--rounds", "1", FAILING_PEER="zeromq")
        self.assertEqual(done.returncode, 1)
        result = self.result()
        self.assertIn("by_hand tcp", [row["name"] for row in result["rows"]])
        self.assertNotIn("zeromq", [row["peer"] for row in result["rows"]])
        reason = next(each["reason"] for each in result["skipped"] if each["name"] == "zeromq")
        self.assertIn("its server is gone", reason)

    def test_the_table_has_a_line_for_each_row_and_its_own_figures_for_the_baseline(self):
        self.install("by_hand", "zeromq")
        lines = self.run_peers("--rounds", "1").stdout.splitlines()
        self.assertIn("p50", lines[0])
        own = find("by_hand", "tcp", "exchange", in_flight=1)["p50_us"]
        self.assertIn(f"{own:.1f} us", lines[1])
        self.assertIn(" 1.00 ", lines[2])
        self.assertEqual(sum(line.startswith("zeromq ") for line in lines), 2)
        self.assertIn("zeromq: 7; as recorded", lines)

    def test_without_any_program_it_says_how_to_build_them(self):
        done = self.run_peers()
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("CLES_BUILD_PEERS", done.stderr)

    def test_names_that_are_none_are_refused(self):
        self.install("by_hand")
        self.assertEqual(self.run_peers("--only", "pigeons").returncode, 2)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
