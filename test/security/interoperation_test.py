#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Files of docs/protocol_security.md that the library writes are read by the reference implementation, and the other way round.

    interoperation_test.py PROGRAM [unittest options]       PROGRAM is cles_security_files
"""

import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from reference_or_skip import r, sodium

PROGRAM = ""


def run(command: str, folder: Path) -> subprocess.CompletedProcess:
    return subprocess.run([PROGRAM, command, str(folder)], capture_output=True, text=True, check=False)


class Scratch(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = Path(scratch.name)


class Written(Scratch):
    """By the library."""

    def setUp(self):
        super().setUp()
        done = run("write", self.folder)
        self.assertEqual((done.returncode, done.stderr), (0, ""))

    def line(self, name: str) -> str:
        text = (self.folder / name).read_text(encoding="utf-8")
        self.assertEqual(text.count("\n"), 1)
        self.assertTrue(text.endswith("\n"))
        return text[:-1]

    def identity(self, name: str) -> r.Identity:
        return r.Identity(r.binary(json.loads(self.line(name))["seed"], 32))

    def test_modes(self):
        for name in ("authority/fleet.key", "car1/key", "car2/key"):
            self.assertEqual((self.folder / name).stat().st_mode & 0o777, 0o600, name)

    def test_keys(self):
        for name in ("car1", "car2"):
            self.assertEqual(json.loads(self.line(f"{name}/key"))["name"], name)
            public = json.loads(self.line(f"{name}/{name}.pub"))
            self.assertEqual(public, {"name": name, "key": r.text(self.identity(f"{name}/key").public)})

    def test_roster(self):
        fleet = self.identity("authority/fleet.key")
        line = self.line("authority/roster")
        self.assertEqual(self.line("car1/car1.join"), line)
        self.assertEqual(self.line("car2/roster"), line)
        roster = r.read_roster(line.encode(), fleet.public)
        # New; gone, car1; without gone; car2; rotated.
        self.assertEqual({key: roster[key] for key in ("version", "last", "generation", "oldest")},
                         {"version": 6, "last": 3, "generation": 4, "oldest": 3})
        car1, car2 = roster["members"]
        self.assertEqual((car1["number"], car1["name"]), (2, "car1"))
        self.assertEqual((car2["number"], car2["name"]), (3, "car2"))
        self.assertFalse({"may", "offers", "forwards"} & set(car1))
        self.assertEqual(car2["may"], ["pull,bind *:localization", '* ä"\\:x/**'])
        self.assertEqual((car2["offers"], car2["forwards"]), ([], ["sat*"]))
        keys = r.group_keys(roster["keys"], fleet)
        for name, member in (("car1", car1), ("car2", car2)):
            identity = self.identity(f"{name}/key")
            self.assertEqual(r.binary(member["key"], 32), identity.public)
            self.assertEqual(r.group_keys(member["keys"], identity), keys)

    def test_signatures(self):
        fleet = self.identity("authority/fleet.key").public
        public = self.identity("car1/key").public
        challenge, sig = (self.folder / "car1/request").read_text(encoding="ascii").splitlines()
        signature, waits_ms = r.request_signature(sig)
        self.assertEqual(waits_ms, 4900)
        request = r.request_to_sign(fleet, "car1", "car2", challenge, "push", "target/a%20b", '{"x":1}', waits_ms)
        r.verify(public, request, signature)
        update = r.update_to_sign(fleet, "car1", "localization", 18, "0000002a", "{}")
        r.verify(public, update, r.binary(self.line("car1/update"), 64))


class Read(Scratch):
    """By the library."""

    def setUp(self):
        super().setUp()
        self.fleet, self.car1, self.car2 = (r.Identity(os.urandom(32)) for _ in range(3))
        self.current, self.next = os.urandom(32), os.urandom(32)
        self.write("key", json.dumps({"name": "car1", "seed": r.text(sodium.crypto_sign_ed25519_sk_to_seed(self.car1.secret))},
                                     separators=(",", ":")), 0o600)

    def write(self, name: str, line: str, mode: int = 0o644) -> None:
        path = self.folder / name
        path.write_text(line + "\n", encoding="utf-8")
        path.chmod(mode)

    def sealed(self, receiver: r.Identity) -> str:
        return r.text(sodium.crypto_box_seal(self.current + self.next, receiver.dh_public))

    def roster(self, **changes) -> dict:
        return {
            "fleet": r.text(self.fleet.public), "version": 41, "last": 2**24 - 1, "generation": 2**32 - 2,
            "oldest": 2**32 - 3, "keys": self.sealed(self.fleet), "members": [
                {"number": 5, "name": "car1", "key": r.text(self.car1.public), "keys": self.sealed(self.car1),
                 "may": ["pull *:ä", '"\\\n\t'], "offers": [], "forwards": ["*"]},
                {"number": 2**24 - 1, "name": "c.a-r_2", "key": r.text(self.car2.public), "keys": self.sealed(self.car2),
                 "note": {"deep": [{"deeper": None}]}}],
            "colour": "red", **changes}

    def read(self) -> dict:
        done = run("read", self.folder)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return json.loads(done.stdout)

    def refused(self) -> str:
        done = run("read", self.folder)
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        return done.stderr

    def test_roster(self):
        self.write("car1.join", r.sign_roster(self.fleet, self.roster(version=40)).decode())
        self.write("roster", r.sign_roster(self.fleet, self.roster()).decode())
        self.assertEqual(self.read(), {
            "node": "car1", "fleet": self.fleet.public.hex(), "version": 41, "last": 2**24 - 1,
            "generation": 2**32 - 2, "oldest": 2**32 - 3, "current": self.current.hex(), "next": self.next.hex(),
            "members": [
                {"number": 5, "name": "car1", "key": self.car1.public.hex(), "agreement": self.car1.dh_public.hex(),
                 "may": ["pull *:ä", '"\\\n\t'], "offers": [], "forwards": ["*"]},
                {"number": 2**24 - 1, "name": "c.a-r_2", "key": self.car2.public.hex(),
                 "agreement": self.car2.dh_public.hex(), "forwards": []}]})

    def test_both_refuse_the_same(self):
        """What the reference implementation refuses, or accepts, the library does too."""
        good = self.roster()
        cases = [(good, True), ({**good, "version": 2**32}, False), ({**good, "must_x": 1}, False),
                 ({**good, "x": {"must_x": 1}}, True), ({**good, "oldest": 2**32 - 2}, True),
                 ({**good, "oldest": 2**32 - 4}, False), ({**good, "last": 7}, False), ({**good, "version": 41.0}, False)]
        for key, value, accepted in (("name", "all", False), ("name", "é", False), ("number", 0, False),
                                     ("may", None, False), ("offers", ["x"], True), ("key", r.text(bytes(32)), False)):
            member = {**good["members"][0], key: value}
            cases.append(({**good, "members": [member, good["members"][1]]}, accepted))
        for roster, accepted in cases:
            line = r.sign_roster(self.fleet, roster)
            self.write("roster", line.decode())
            if accepted:
                r.read_roster(line, self.fleet.public)
                self.read()
            else:
                with self.assertRaises(r.Refused):
                    r.read_roster(line, self.fleet.public)
                self.assertIn("roster", self.refused())

    def test_it_is_for_members(self):
        self.write("roster", r.sign_roster(self.fleet, self.roster(members=[])).decode())
        self.assertIn("car1's key is not in version 41 of the roster", self.refused())


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main(verbosity=2)
