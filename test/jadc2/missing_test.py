#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The messages of joint command if something is missing: no other node, no plugin, a port in use, wrong usage.

    missing_test.py PROGRAMS
"""

import json
import os
import signal
import socket
import subprocess
import sys
import unittest

from jadc2_fleet import Fleet, Trouble, clean_environment, free_port

PROGRAMS = sys.argv[1]


def run(*arguments):
    """Exit code, stdout, stderr."""
    done = subprocess.run([os.path.join(PROGRAMS, "cles-jadc2"), *arguments], stdin=subprocess.DEVNULL, capture_output=True,
                          text=True, timeout=60, check=False, env=clean_environment())
    return done.returncode, done.stdout, done.stderr


class Missing(unittest.TestCase):
    def setUp(self):
        self.fleet = Fleet(PROGRAMS).__enter__()
        self.addCleanup(lambda: self.fleet.__exit__(None, None, None))

    def test_no_satellite(self):
        recon = self.fleet.recon([f"tcp://127.0.0.1:{free_port()}"], "--frames", "20")
        self.assertEqual(recon.end(), 3)
        self.assertEqual(recon.all("trouble")[0]["text"], "no processing: no node answers at the given address "
                                                          "(--satellite): is clesd running there?")
        frames = recon.all("report")[0]["data"]["frames"]
        self.assertEqual((frames["captured"], frames["done"]), (20, 0))
        self.assertEqual(frames["missing"] + frames["skipped"], 20)

    def test_a_satellite_without_the_plugin(self):
        satellite = self.fleet.satellite(plugins=[])
        recon = self.fleet.recon([satellite])
        said = recon.wait_for("trouble", "sat1")["text"]
        self.assertRegex(said, "of sat1 \\(live\\): is libcles-fmv.so among the plugins of a node\\?$")
        recon.stop(signal.SIGINT)
        self.assertEqual(recon.end(), 3)

    def test_no_recon(self):
        at = f"tcp://127.0.0.1:{free_port()}"
        mission = self.fleet.mission(at, [at], "--duration", "1")
        self.assertEqual(mission.end(), 3)
        self.assertRegex(mission.all("trouble")[0]["text"],
                         f"^no tracks: .*: is cles-jadc2 recon running at {at} \\(--recon\\)\\?$")
        self.assertEqual(len(mission.all("trouble")), 1)  # reported once
        self.assertEqual(mission.all("report")[0]["data"]["given"], 0)

    def check_refused(self, strikers, words, *arguments):
        recon = self.fleet.recon([self.fleet.satellite()], "--fps", "30")
        mission = self.fleet.mission(recon, strikers, "--duration", "60", *arguments)
        self.assertEqual(mission.end(), 3, mission.events)
        told = mission.all("strike")[0]["data"]
        self.assertEqual(told["fate"], "refused")
        self.assertIn(words, told["trouble"])
        self.assertEqual(mission.all("report")[0]["data"],
                         {"given": 1, "done": 0, "hit": 0, "missed": 0, "unseen": 0, "refused": 1, "failed": 0, "aborted": 0,
                          "unknown": 0, "open": 0})

    def test_no_strike_aircraft(self):
        self.check_refused([f"tcp://127.0.0.1:{free_port()}"], "no node answers at the given address (--strike)")

    def test_a_strike_aircraft_without_the_plugin(self):
        self.check_refused([self.fleet.striker(plugins=[])], "is libcles-strike.so among the plugins of a node?")

    def test_no_weapon_anywhere(self):
        plugin = f"{{path: {self.fleet.plugin('strike')}, config: {{weapons: 0}}}}"
        self.check_refused([self.fleet.striker(plugins=[plugin])], "no weapon is left")

    def test_an_audit_file_that_cannot_be_written(self):
        striker = self.fleet.striker()
        self.check_refused([striker], "the audit file cannot be written", "--audit", "/dev/full")
        self.assertEqual(striker.pull("strike1:strike"), {"left": 4, "orders": []})

    def test_orders_that_must_be_signed_where_nobody_has_a_key(self):
        plugin = f"{{path: {self.fleet.plugin('strike')}, config: {{must_be_signed: true}}}}"
        self.check_refused([self.fleet.striker(plugins=[plugin])], "strike1: 'strike' requires signed requests, and this node has no security")

    def test_settings_of_a_plugin_that_cannot_be(self):
        plugin = f"{{path: {self.fleet.plugin('strike')}, config: {{weapons: 5000}}}}"
        with self.assertRaisesRegex(Trouble, "weapons: 1000 at most"):
            self.fleet.striker(plugins=[plugin])
        plugin = f"{{path: {self.fleet.plugin('strike')}, config: {{ledger: /nowhere/orders}}}}"
        with self.assertRaisesRegex(Trouble, "cannot open the ledger"):
            self.fleet.striker(plugins=[plugin])
        plugin = f"{{path: {self.fleet.plugin('fmv')}, config: {{streams: 0}}}}"
        with self.assertRaisesRegex(Trouble, "streams: 1 to 64"):
            self.fleet.satellite(plugins=[plugin])

    def test_a_port_that_is_taken(self):
        with socket.create_server(("127.0.0.1", 0)) as holder:
            at = f"tcp://127.0.0.1:{holder.getsockname()[1]}"
            code, out, err = run("recon", "--listen", at)
        self.assertEqual((code, out), (5, ""))
        self.assertIn(at, err)
        self.assertIn("in use", err)

    def test_listening_to_everybody_takes_a_word(self):
        for everybody, other in (("--listen", "--camera-listen"), ("--camera-listen", "--listen")):
            code, _, err = run("recon", everybody, "tcp://0.0.0.0:0", other, "tcp://127.0.0.1:0")
            self.assertEqual(code, 5)
            self.assertIn("insecure", err)

    def test_wrong_usage(self):
        for arguments in ([], ["nonsense"], ["recon", "--fps", "0"], ["mission", "--strikes", "0"], ["recon", "--seed", "x"], ["recon", "--seed", "-1"], ["recon", "--frames", "-1"],
                          ["load", "--streams", "65"], ["mission", "--duration", "-1"], ["rehearse", "--scans", "31"],
                          ["compare", "--scenes", "0"], ["compare", "--seconds", "2.9"], ["rehearse", "--delay", "2.1"], ["rehearse", "--strikes", "0"], ["rehearse", "--seed", "-1"]):
            code, out, err = run(*arguments)
            self.assertEqual((code, out), (2, ""), arguments)
            self.assertNotEqual(err, "")
        for arguments in (["recon", "--satellite", "nonsense"], ["mission", "--recon", "nonsense"]):
            at = ("--listen", "tcp://127.0.0.1:0", "--camera-listen", "tcp://127.0.0.1:0")
            code, _, err = run(*arguments, *(at if arguments[0] == "recon" else ()))
            self.assertEqual(code, 5, arguments)
            self.assertIn("nonsense", err)

    def test_rehearsing(self):
        for seed in ("1", "18446744073709551615"):
            code, out, err = run("rehearse", "--strikes", "3", "--seed", seed)
            self.assertEqual((code, err), (0, ""))
            for record in json.loads(out).values():
                self.assertEqual((record["strikes"], record["not_aimed"]), (3, 0))
                self.assertGreater(record["expected_sigma"], 0)
                self.assertLess(record["median_missed_by"], 20)

    def test_comparing(self):
        for seed in ("1", "18446744073709551615"):
            code, out, err = run("compare", "--scenes", "2", "--seconds", "4", "--seed", seed)
            self.assertEqual((code, err), (0, ""))
            told = json.loads(out)
            self.assertLessEqual(told["fused"], told["scenes"])
            self.assertLessEqual(told["scenes"], 2)
            self.assertLessEqual(told["with_plots"]["expected_sigma"], told["camera_alone"]["expected_sigma"])

    def test_an_impact_that_is_nowhere(self):
        recon = self.fleet.recon([self.fleet.satellite()])
        for body in ('{"by":"","target":0,"lat":null,"lon":0,"utc":0}', '{"by":"","target":0,"lat":0,"lon":1e308,"utc":0}'):
            done = subprocess.run([os.path.join(PROGRAMS, "cles"), "push", "self:impact", "-d", body, "--at", recon.url],
                                  stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False,
                                  env={**clean_environment(), "CLES_MULTICAST": "off"})
            self.assertEqual((done.returncode, done.stdout), (5, ""))
            self.assertIn("bad_request: recon: lat, lon and utc: degrees", done.stderr)

    def test_a_load_of_more_streams_than_are_taken(self):
        satellite = self.fleet.satellite(plugins=[f"{{path: {self.fleet.plugin('fmv')}, config: {{streams: 2}}}}"])
        code, out, err = run("load", "--streams", "4", "--duration", "30", "--at", satellite.url)
        self.assertEqual((code, out), (6, ""), err)
        self.assertIn("the limit of streams is reached", err)

    def test_measuring_where_nobody_is(self):
        at = f"tcp://127.0.0.1:{free_port()}"
        for what in (["drill", "--count", "1"], ["load", "--streams", "1"]):
            code, _, err = run(*what, "--at", at)
            self.assertEqual(code, 5, what)
            self.assertIn("cles-jadc2: ", err)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
