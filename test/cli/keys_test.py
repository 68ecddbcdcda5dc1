#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""cles keys: the key of a node, and how it joins a fleet."""

import base64
import json
import os
import ssl
import stat
import subprocess
import time
import unittest
from pathlib import Path

from support import CLES, PATIENCE, environment
from trust_support import Trust


class New(Trust):
    def test_it_creates_a_key_that_only_the_owner_can_read(self):
        done = self.run_in("keys", "new", "car1", "--keys", "etc/cles/car1")
        self.assertEqual((done.code, done.out), (0, "etc/cles/car1/car1.pub\n"), done.err)
        self.assertIn("next: carry etc/cles/car1/car1.pub to the fleet's authority, and run there: cles fleet add car1.pub "
                      "--may RIGHT", done.err)
        shown = self.json("keys", "show", "-k", "etc/cles/car1")["fingerprint"]
        self.assertIn(f"its fingerprint is {shown}: compare it with what 'cles fleet add' prints", done.err)
        folder = self.path("etc/cles/car1")
        self.assertEqual(sorted(os.listdir(folder)), ["car1.pub", "key"])
        self.assertEqual(stat.S_IMODE(folder.stat().st_mode), 0o700)
        self.assertEqual(stat.S_IMODE((folder / "key").stat().st_mode), 0o600)
        public = json.loads((folder / "car1.pub").read_text())
        self.assertEqual(set(public), {"name", "key"})
        # The private key is nowhere else.
        seed = json.loads((folder / "key").read_text())["seed"]
        self.assertNotIn(seed, done.out + done.err + (folder / "car1.pub").read_text())

    def test_it_never_replaces_a_key(self):
        self.good("keys", "new", "car1", "-k", "car1")
        before = self.path("car1/key").read_bytes()
        for name in ("car1", "car2"):
            self.failed("keys", "new", name, "-k", "car1", says="car1/key already exists, and is never replaced")
        self.assertEqual(self.path("car1/key").read_bytes(), before)

    def test_names(self):
        for name, says in (("car 1", "is not a name"), ("", "is not a name"), ("x" * 65, "is not a name"),
                           ("../car1", "is not a name"), ("self", "cannot be the name"), ("all", "cannot be the name"),
                           ("..", "begins with '.'"), (".hidden", "begins with '.'")):
            self.refused("keys", "new", name, "-k", "car1", says=says)
        self.assertFalse(self.path("car1").exists())

    def test_where_the_keys_are(self):
        for i, (variables, place) in enumerate((
                ({"CLES_KEYS": "variable"}, "variable"),
                ({"CLES_KEYS": "", "XDG_CONFIG_HOME": "{}/xdg", "HOME": "{}/home"}, "xdg/cles/keys"),
                ({"XDG_CONFIG_HOME": "", "HOME": "{}/home"}, "home/.config/cles/keys"))):
            env = environment(**{name: value.format(self.path("")) for name, value in variables.items()})
            self.good("keys", "new", f"car{i}", env=env)
            self.assertTrue(self.path(place, "key").is_file(), place)
            self.assertIn(f"car{i}", self.good("keys", "show", env=env).out)
        self.refused("keys", "show", env=environment(XDG_CONFIG_HOME="", HOME=""), says="Give --keys DIR")

    def test_a_folder_that_others_can_change_is_refused(self):
        self.path("car1").mkdir()
        self.path("car1").chmod(0o777)
        self.failed("keys", "new", "car1", "-k", "car1", says="can be changed by other users: chmod go-w car1")
        self.path("file").write_text("")
        self.failed("keys", "new", "car1", "-k", "file", says="Not a directory")
        self.failed("keys", "new", "car1", "-k", "file/car1", says="cannot create the folder file: ")


class Show(Trust):
    def test_before_and_after_it_has_joined(self):
        self.good("keys", "new", "car1", "-k", "car1")
        key = json.loads(self.path("car1/car1.pub").read_text())["key"]
        shown = self.json("keys", "show", "-k", "car1")
        fingerprint = shown["fingerprint"]
        self.assertEqual(shown, {"name": "car1", "key": key, "fingerprint": fingerprint, "member": False,
                                 "reason": "there is no roster", "rules": 0})
        self.assertIn("fleet     none: there is no roster\n", self.good("keys", "show", "-k", "car1", "-o", "table").out)

        fleet = self.fleet()
        self.good("fleet", "add", "car1/car1.pub", "-k", "fleet", "--may", "pull *:*", "--forwards", "sat*")
        self.good("keys", "join", "fleet/car1.join", "-k", "car1")
        shown = self.json("keys", "show", "-k", "car1")
        self.assertEqual(shown, {"name": "car1", "key": key, "fingerprint": fingerprint, "fleet": fleet["fleet"],
                                 "version": 2, "member": True, "may": ["pull *:*"], "forwards": ["sat*"], "rules": 0})
        text = self.good("keys", "show", "-k", "car1", "-o", "table").out
        for line in ("node      car1", f"key       {key}", f"          fingerprint {fingerprint}", f"fleet     {fleet['fleet']}", "roster    version 2",
                     "may       'pull *:*'", "offers    everything", "forwards  'sat*'", "rules     0 rules"):
            self.assertIn(line + "\n", text)

    def test_rules(self):
        self.joined("car1")
        self.path("car1/rules").write_text("deny sat* may push *:target # no\n")
        self.assertEqual(self.json("keys", "show", "-k", "car1")["rules"], 1)
        self.assertIn("rules     1 rule\n", self.good("keys", "show", "-k", "car1", "-o", "table").out)
        self.path("car1/rules").write_text("\n\nDeny * may push *:target\n")
        shown = self.json("keys", "show", "-k", "car1")
        self.assertEqual(shown["rules"], 0)
        self.assertIn("line 3: 'Deny * may push *:target': a rule begins with", shown["rules_error"])
        self.assertIn("rules     everything is denied: line 3", self.good("keys", "show", "-k", "car1", "-o", "table").out)

    def test_what_cannot_be_read(self):
        self.failed("keys", "show", "-k", "car1", says="cannot open the folder car1: No such file")
        self.path("car1").mkdir()
        self.failed("keys", "show", "-k", "car1", says="car1/key does not exist: 'cles keys new' creates it")
        self.good("keys", "new", "car1", "-k", "car1")
        self.path("car1/key").chmod(0o640)
        self.failed("keys", "show", "-k", "car1", says="car1/key is accessible to other users: chmod 600 car1/key")
        self.path("car1/key").chmod(0o600)
        self.path("car1/roster").write_text("{}")
        self.failed("keys", "show", "-k", "car1", says="car1/roster: ")


class Cert(Trust):
    def test_other_programs_can_load_it(self):
        self.good("keys", "new", "car1", "-k", "car1")
        done = self.good("keys", "cert", "-k", "car1")
        self.assertEqual(done.out, "car1/tls.pem\n")
        self.assertIn("the file contains the private key, as 'key' does, and stays in car1", done.err)
        path = self.path("car1/tls.pem")
        self.assertEqual(stat.S_IMODE(path.stat().st_mode), 0o600)
        ssl.create_default_context().load_cert_chain(path)  # it refuses a certificate that is not of the key
        pem = path.read_text()
        der = ssl.PEM_cert_to_DER_cert(pem[pem.index("-----BEGIN CERTIFICATE"):])
        public = json.loads(self.path("car1/car1.pub").read_text())["key"]
        key = bytes.fromhex("302a300506032b6570032100") + base64.urlsafe_b64decode(public + "=")
        self.assertIn(key, der)
        self.good("keys", "cert", "-k", "car1")
        self.assertEqual(path.read_text(), pem)
        self.assertNotIn(pem.splitlines()[1], done.out + done.err)

    def test_without_a_key(self):
        self.path("car1").mkdir()
        self.failed("keys", "cert", "-k", "car1", says="car1/key does not exist: 'cles keys new' creates it")


class Join(Trust):
    def test_it_prints_the_fleet_and_stores_the_roster(self):
        self.good("keys", "new", "car1", "-k", "car1")
        fleet = self.fleet()
        self.good("fleet", "add", "car1/car1.pub", "--may", "all", "-k", "fleet")
        done = self.good("keys", "join", "fleet/car1.join", "-k", "car1")
        self.assertEqual(done.out, fleet["fleet"] + "\n")
        self.assertIn("car1 is a member of the fleet with this key, by version 2 of the roster", done.err)
        self.assertEqual(self.path("car1/roster").read_bytes(), self.path("fleet/car1.join").read_bytes())

    def test_from_stdin(self):
        self.good("keys", "new", "car1", "-k", "car1")
        self.fleet()
        self.good("fleet", "add", "-", "--may", "all", "-k", "fleet", stdin=self.path("car1/car1.pub").read_text())
        self.good("keys", "join", "-", "-k", "car1", stdin=self.path("fleet/car1.join").read_text())
        self.assertTrue(self.json("keys", "show", "-k", "car1")["member"])
        self.failed("keys", "join", "-", "-k", "car1", stdin="nonsense", says="stdin: a roster is a line of the form")

    def test_only_a_roster_with_this_node(self):
        self.joined("car1")
        self.good("keys", "new", "car2", "-k", "car2")
        self.failed("keys", "join", "fleet/car1.join", "-k", "car2", says="fleet/car1.join: version 2 of the roster does "
                    "not contain car2")
        self.good("keys", "new", "car1", "-k", "other")
        self.failed("keys", "join", "fleet/car1.join", "-k", "other", says="has another key of car1")
        self.assertFalse(self.path("other/roster").exists())

    def test_only_one_fleet(self):
        self.joined("car1")
        self.good("fleet", "init", "second")
        self.good("fleet", "add", "car1/car1.pub", "--may", "all", "-k", "second")
        self.failed("keys", "join", "second/car1.join", "-k", "car1", says="of another fleet than that in car1")
        self.assertEqual(self.json("keys", "show", "-k", "car1")["fleet"], self.fleet_of("fleet")["fleet"])

    def test_never_an_older_one(self):
        self.joined("car1")
        self.good("fleet", "rotate", "-k", "fleet")
        self.good("keys", "join", "fleet/roster", "-k", "car1")
        self.failed("keys", "join", "fleet/car1.join", "-k", "car1", says="car1 has a roster that is newer")
        self.assertEqual(self.json("keys", "show", "-k", "car1")["version"], 3)

    def test_what_is_no_roster(self):
        self.good("keys", "new", "car1", "-k", "car1")
        self.refused("keys", "join", "nowhere", "-k", "car1", says="cannot read nowhere: No such file")
        self.refused("keys", "join", "/", "-k", "car1", says="cannot read /: Is a directory")
        self.refused("keys", "join", "/dev/zero", "-k", "car1", says="/dev/zero is longer than any file that is carried")
        for text in ("", "{}", "x" * 500, '{"signature":"' + "A" * 86 + '","roster":{}}'):
            self.path("wrong").write_text(text)
            self.failed("keys", "join", "wrong", "-k", "car1", says="wrong: ")
        self.joined("car2")
        line = self.path("fleet/car2.join").read_text()
        self.path("wrong").write_text(line.replace('"version":2', '"version":3'))
        self.failed("keys", "join", "wrong", "-k", "car2", says="not signed")


class Secrets(Trust):
    def test_there_are_no_core_dumps_while_keys_are_read(self):
        self.good("keys", "new", "car1", "-k", "car1")
        with subprocess.Popen([CLES, "keys", "join", "-", "-k", "car1"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, env=environment(), cwd=self.path("")) as waiting:
            limits = Path(f"/proc/{waiting.pid}/limits")
            end = time.monotonic() + PATIENCE
            while not any(line.split()[4] == "0" for line in limits.read_text().splitlines()
                          if line.startswith("Max core file size")):
                self.assertLess(time.monotonic(), end, "core dumps are not turned off")
                time.sleep(0.01)
            waiting.communicate(b"", timeout=PATIENCE)
            self.assertEqual(waiting.returncode, 1)

    def test_no_command_prints_a_secret(self):
        self.good("fleet", "init", "fleet", "--with", "car1,car2")
        seeds = [json.loads(self.path(name).read_text())["seed"] for name in ("fleet/fleet.key", "fleet/car1/key")]
        for command in (["keys", "show", "-k", "fleet/car1"], ["fleet", "show", "-k", "fleet"],
                        ["keys", "show", "-k", "fleet/car1", "-o", "raw"], ["fleet", "show", "-k", "fleet", "-o", "raw"],
                        ["fleet", "rotate", "-k", "fleet", "-vv"], ["keys", "join", "fleet/roster", "-k", "fleet/car1"],
                        ["access", "car1", "pull", "car2:x", "-k", "fleet/car1"]):
            done = self.good(*command)
            for seed in seeds:
                self.assertNotIn(seed, done.out + done.err, command)


if __name__ == "__main__":
    unittest.main()
