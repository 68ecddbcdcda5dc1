#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""cles fleet: who is a member, and what members may do."""

import os
import stat
import subprocess
import unittest

from support import CLES, PATIENCE, environment
from trust_support import Trust


class Init(Trust):
    def test_a_fleet_without_members(self):
        done = self.good("fleet", "init", "some/fleet")
        self.assertEqual(done.out, "some/fleet\n")
        self.assertIn("keep some/fleet/fleet.key off the nodes", done.err)
        self.assertIn("cles fleet add car1.pub --may RIGHT --keys some/fleet", done.err)
        self.assertEqual(stat.S_IMODE(self.path("some/fleet/fleet.key").stat().st_mode), 0o600)
        self.assertEqual({name for name in os.listdir(self.path("some/fleet")) if not name.startswith(".")},
                         {"fleet.key", "roster"})
        fleet = self.fleet_of("some/fleet")
        self.assertEqual((fleet["version"], fleet["generation"], fleet["oldest"], fleet["members"]), (1, 1, 1, []))
        self.assertIn("no members\n", self.good("fleet", "show", "-k", "some/fleet", "-o", "table").out)
        self.assertNotIn(" carry ", self.good("fleet", "rotate", "-k", "some/fleet").err)  # to whom?

    def test_with_nodes_on_this_host(self):
        done = self.good("fleet", "init", "fleet/", "--with", "car1,car2")
        self.assertEqual(done.out, "fleet/\nfleet/car1\nfleet/car2\n")
        for name in ("car1", "car2"):
            node = self.json("keys", "show", "-k", f"fleet/{name}")
            self.assertEqual((node["name"], node["member"], node["version"]), (name, True, 2))
        self.assertEqual([m["name"] for m in self.fleet_of("fleet")["members"]], ["car1", "car2"])

    def test_invalid_names_create_nothing(self):
        for text, says in (("car1,", "--with 'car1,'"), (",", "is not a name"), ("car1,,car2", "'' is not a name"),
                           ("car 1", "is not a name"), ("car1,car2,car1", "a name is there twice"), ("car1,self", "cannot be the name"), ("../x", "is not a name"),
                           ("..", "begins with '.'"), (".", "begins with '.'"), ("car1,.hidden", "begins with '.'"),
                           ("car1,-rf", "begins with '-'"), ("roster", "name of a folder in fleet"),
                           ("fleet.key", "name of a folder"), ("car1,car1.join", "name of a folder")):
            self.refused("fleet", "init", "fleet", "--with", text, says=says)
        self.assertEqual(os.listdir(self.path("")), [])
        self.path("fleet").mkdir()
        self.path("fleet/car1").mkdir()
        self.failed("fleet", "init", "fleet", "--with", "car1", says="fleet/car1 already exists")
        self.assertEqual(os.listdir(self.path("fleet")), ["car1"])

    def test_a_fleet_is_never_replaced(self):
        self.fleet()
        before = self.path("fleet/fleet.key").read_bytes()
        self.failed("fleet", "init", "fleet", says="fleet already contains the roster of a fleet")
        self.path("fleet/roster").unlink()
        self.failed("fleet", "init", "fleet", says="fleet/fleet.key already exists: put the fleet's newest roster there")
        self.assertEqual(self.path("fleet/fleet.key").read_bytes(), before)
        self.refused("fleet", "init", says="directory")


class Add(Trust):
    def test_several_nodes(self):
        self.fleet()
        for name in ("car1", "car2"):
            self.good("keys", "new", name, "-k", name)
        done = self.good("fleet", "add", "car1/car1.pub", "car2/car2.pub", "--may", "all", "-k", "fleet")
        self.assertEqual(done.out, "fleet/car1.join\nfleet/car2.join\n")
        self.assertIn("version 2 of the roster is in fleet", done.err)
        for name in ("car1", "car2"):
            shown = self.json("keys", "show", "-k", name)["fingerprint"]
            self.assertRegex(shown, "^([0-9a-f]{4}-){4}[0-9a-f]{4}$")
            self.assertIn(f"{name} has the fingerprint {shown}: compare it with that of 'cles keys show' at {name}", done.err)
        self.assertIn("next: carry each NAME.join to the node NAME, and run there: cles keys join NAME.join", done.err)
        members = self.fleet_of("fleet")["members"]
        self.assertEqual([(m["number"], m["name"], m["forwards"]) for m in members], [(1, "car1", []), (2, "car2", [])])
        self.assertEqual([set(m) & {"may", "offers"} for m in members], [set(), set()])  # everything

    def test_rights(self):
        self.fleet()
        self.good("keys", "new", "car1", "-k", "car1")
        self.good("fleet", "add", "car1/car1.pub", "-k", "fleet", "--may", "pull,bind *:*/**", "--may", "push car2:target",
                  "--offers", "none", "--forwards", "sat*", "--forwards", "car2")
        (member,) = self.fleet_of("fleet")["members"]
        self.assertEqual((member["may"], member["offers"], member["forwards"]),
                         (["pull,bind *:*/**", "push car2:target"], [], ["sat*", "car2"]))
        self.assertRegex(self.good("fleet", "show", "-k", "fleet", "-o", "table").out,
                         r"\n +1 +car1 +'pull,bind \*:\*/\*\*', 'push car2:target' +nothing +'sat\*', 'car2'\n")

    def test_invalid_rights_change_nothing(self):
        self.fleet()
        self.good("keys", "new", "car1", "-k", "car1")
        for options, says in ((["--may", "pull"], "--may 'pull': 'pull' is not VERBS NOUN"),
                              (["--may", "pull *:x", "--may", "Pull *:x"], "--may 'Pull *:x': 'Pull' is not a verb"),
                              (["--offers", "pull *:x/**/y"], "--offers 'pull *:x/**/y': the parameter '**'"),
                              (["--may", "pull self:x"], "no node has the name 'self'"),
                              (["--may", "all", "--may", "pull *:x"], "--may 'all': excludes any other --may"),
                              (["--may", ""], "--may ''"),
                              (["--forwards", "car 1"], "--forwards 'car 1': 'car 1' is not the pattern of a name"),
                              (["--forwards", "**"], "'**' is not the pattern of a name"),
                              (["--forwards", "car1", "--forwards", "none"], "--forwards 'none': excludes any other")):
            self.refused("fleet", "add", "car1/car1.pub", "-k", "fleet", *options, says=says)
        self.assertEqual(self.fleet_of("fleet")["version"], 1)

    def test_rights_are_not_given_by_leaving_them_out(self):
        self.fleet()
        self.good("keys", "new", "car1", "-k", "car1")
        for options in ([], ["--offers", "none"], ["--forwards", "all"]):
            for choice in ("--may RIGHT", "--may none", "--may all"):
                self.refused("fleet", "add", "car1/car1.pub", "-k", "fleet", *options, says=choice)
        self.assertEqual(self.fleet_of("fleet")["version"], 1)
        self.good("fleet", "add", "car1/car1.pub", "-k", "fleet", "--may", "none")
        (member,) = self.fleet_of("fleet")["members"]
        self.assertEqual(member["may"], [])

    def test_an_exchanged_file_has_another_fingerprint(self):
        self.fleet()
        for folder in ("car1", "thief"):
            self.good("keys", "new", "car1", "-k", folder)
        done = self.good("fleet", "add", "thief/car1.pub", "-k", "fleet", "--may", "all")
        self.assertNotIn(self.json("keys", "show", "-k", "car1")["fingerprint"], done.err)
        self.assertIn(self.json("keys", "show", "-k", "thief")["fingerprint"], done.err)

    def test_names_that_cannot_be_those_of_files(self):
        self.fleet()
        self.good("keys", "new", "car1", "-k", "car1")
        line = self.path("car1/car1.pub").read_text()
        before = sorted(os.listdir(self.path("fleet")))
        for name in ("..", ".hidden", "-rf"):
            self.path("it.pub").write_text(line.replace("car1", name))
            self.failed("fleet", "add", "it.pub", "-k", "fleet", "--may", "all", says=f"'{name}' cannot be the name of a member")
        self.assertEqual(self.fleet_of("fleet")["version"], 1)
        self.assertEqual(sorted(os.listdir(self.path("fleet"))), before)

    def test_what_is_no_public_key(self):
        self.joined("car1")
        self.refused("fleet", "add", "--may", "all", "-k", "fleet", says="files")
        self.refused("fleet", "add", "nowhere.pub", "--may", "all", "-k", "fleet", says="cannot read nowhere.pub: No such file")
        self.failed("fleet", "add", "car1/key", "--may", "all", "-k", "fleet", says="car1/key: ")
        self.failed("fleet", "add", "fleet/roster", "--may", "all", "-k", "fleet", says="fleet/roster: ")
        self.failed("fleet", "add", "car1/car1.pub", "--may", "all", "-k", "fleet", says="car1 is already a member")
        line = self.path("car1/car1.pub").read_text()
        self.path("car2.pub").write_text(line.replace("car1", "car2"))
        self.failed("fleet", "add", "car2.pub", "--may", "all", "-k", "fleet", says="is that of the member car1")
        self.path("all.pub").write_text(line.replace("car1", "all"))
        self.failed("fleet", "add", "all.pub", "--may", "all", "-k", "fleet", says="all.pub: ")
        # One wrong file, and none is added.
        self.good("keys", "new", "car3", "-k", "car3")
        self.failed("fleet", "add", "car3/car3.pub", "car1/car1.pub", "--may", "all", "-k", "fleet", says="already a member")
        self.assertEqual(self.fleet_of("fleet")["version"], 2)
        self.assertFalse(self.path("fleet/car3.join").exists())

    def test_without_an_authority(self):
        self.joined("car1")
        self.good("keys", "new", "car2", "-k", "car2")
        self.failed("fleet", "add", "car2/car2.pub", "--may", "all", "-k", "car1", says="car1/fleet.key does not exist: 'cles fleet init'")
        self.path("fleet/fleet.key").chmod(0o644)
        self.failed("fleet", "add", "car2/car2.pub", "--may", "all", "-k", "fleet", says="chmod 600 fleet/fleet.key")
        self.path("fleet/fleet.key").chmod(0o600)
        for roster in (self.path("fleet").glob("*")):
            if roster.name != "fleet.key":
                roster.unlink()
        self.failed("fleet", "add", "car2/car2.pub", "--may", "all", "-k", "fleet", says="fleet contains no roster: put the fleet's newest")

    def test_at_the_same_time(self):
        self.fleet()
        names = [f"car{i}" for i in range(8)]
        for name in names:
            self.good("keys", "new", name, "-k", name)
        started = [subprocess.Popen([CLES, "fleet", "add", f"{name}/{name}.pub", "--may", "all", "-k", "fleet"],
                                    cwd=self.path(""), env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                   for name in names]
        added = []
        for name, process in zip(names, started):
            _, err = process.communicate(timeout=PATIENCE)
            if process.returncode == 0:
                added.append(name)
            else:
                self.assertIn("changed by another process at the same time: repeat the command", err)
        fleet = self.fleet_of("fleet")
        self.assertEqual({m["name"] for m in fleet["members"]}, set(added))
        self.assertEqual(fleet["version"], 1 + len(added))


class Change(Trust):
    def test_rights(self):
        self.joined("car1", "car2")
        done = self.good("fleet", "rights", "car1", "--may", "pull *:x", "--forwards", "sat*", "-k", "fleet")
        self.assertEqual(done.out, "may       'pull *:x'\noffers    everything\nforwards  'sat*'\n")
        self.assertIn("version 3 of the roster is in fleet", done.err)
        self.assertIn("next: carry fleet/roster to one of the members", done.err)
        # What is not named stays.
        done = self.good("fleet", "rights", "car1", "--offers", "none", "-k", "fleet")
        self.assertEqual(done.out, "may       'pull *:x'\noffers    nothing\nforwards  'sat*'\n")
        done = self.good("fleet", "rights", "car1", "--may", "all", "--offers", "all", "--forwards", "all", "-k", "fleet")
        self.assertEqual(done.out, "may       everything\noffers    everything\nforwards  '*'\n")
        self.assertEqual([m["forwards"] for m in self.fleet_of("fleet")["members"]], [["*"], []])

        self.refused("fleet", "rights", "car1", "-k", "fleet", says="give the rights that change")
        self.refused("fleet", "rights", "car1", "--may", "x", "-k", "fleet", says="--may 'x'")
        self.failed("fleet", "rights", "car3", "--may", "all", "-k", "fleet", says="'car3' is not a member of the fleet")
        self.assertEqual(self.fleet_of("fleet")["version"], 5)

    def test_removal(self):
        self.joined("car1", "car2", "car3")
        self.failed("fleet", "remove", "car1", "car9", "-k", "fleet", says="'car9' is not a member of the fleet")
        done = self.good("fleet", "remove", "car1", "car3", "-k", "fleet")
        self.assertEqual(done.out, "")
        self.assertIn("cles keys join roster; the others get it from that one", done.err)
        fleet = self.fleet_of("fleet")
        self.assertEqual([(m["number"], m["name"]) for m in fleet["members"]], [(2, "car2")])
        self.assertEqual((fleet["version"], fleet["generation"], fleet["oldest"]), (3, 3, 3))
        self.failed("keys", "join", "fleet/roster", "-k", "car1", says="does not contain car1")
        self.good("keys", "join", "fleet/roster", "-k", "car2")
        # Who returns gets a new number.
        self.good("fleet", "add", "car1/car1.pub", "--may", "all", "-k", "fleet")
        self.assertEqual([m["number"] for m in self.fleet_of("fleet")["members"]], [2, 4])

    def test_rotation(self):
        self.joined("car1")
        for version in range(3, 6):
            self.good("fleet", "rotate", "-k", "fleet")
            fleet = self.fleet_of("fleet")
            self.assertEqual((fleet["version"], fleet["generation"], fleet["oldest"]), (version, version - 1, version - 2))
        self.good("keys", "join", "fleet/roster", "-k", "car1")

    def test_show_needs_only_a_roster(self):
        self.joined("car1")
        self.assertEqual(self.fleet_of("car1"), self.fleet_of("fleet"))
        self.assertEqual(self.good("fleet", "show", "-k", "car1", "-o", "raw").out, self.path("car1/roster").read_text())
        self.failed("fleet", "show", "-k", "nowhere", says="cannot open the folder nowhere")
        self.path("empty").mkdir()
        self.failed("fleet", "show", "-k", "empty", says="empty contains no roster")

    def test_a_fork_is_reported(self):
        self.joined("car1")
        self.good("keys", "new", "car2", "-k", "car2")
        self.path("backup").mkdir()
        for name in ("roster", "fleet.key"):
            content = self.path("fleet", name).read_bytes()
            self.path("backup", name).write_bytes(content)
            self.path("backup", name).chmod(0o600)
        self.good("fleet", "rotate", "-k", "fleet")
        self.good("fleet", "add", "car2/car2.pub", "--may", "all", "-k", "backup")
        self.path("fleet/car2.join").write_bytes(self.path("backup/car2.join").read_bytes())
        self.assertIn("has the same version, so it is ignored; the next version ends the fork",
                      self.good("fleet", "show", "-k", "fleet").err)


if __name__ == "__main__":
    unittest.main()
