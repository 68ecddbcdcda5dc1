#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Joint command with security: it succeeds as without, each role has its own rights only, and a strike has to be signed.

    secured_test.py PROGRAMS
"""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import unittest

from jadc2_fleet import FINDS, PATIENCE, RIGHTS, Fleet, clean_environment, free_port
from story import StoryTest, namespaces

PROGRAMS = sys.argv[1]
# May watch, like the mission centre, but not strike.
OBSERVER = {"observer": {"may": ["bind recon:tracks", *FINDS], "offers": []}}


def order(name="o1"):
    """Against a place north of all roads."""
    now = time.time()
    return json.dumps({"id": name, "lat": 33.21, "lon": -106.4, "ve": 1, "vn": 1, "sigma": 3, "sigma_v": 1, "utc": now,
                       "until": now + 60})


def run(*arguments):
    """Exit code, stdout, stderr."""
    done = subprocess.run([os.path.join(PROGRAMS, "cles-jadc2"), *arguments], stdin=subprocess.DEVNULL, capture_output=True,
                          text=True, timeout=60, check=False, env=clean_environment())
    return done.returncode, done.stdout, done.stderr


class Story(StoryTest):
    def test_from_the_first_frame_to_the_strike(self):
        with Fleet(PROGRAMS, rights=RIGHTS) as fleet:
            satellite, recon, striker = self.run_story(fleet)
            for node in (satellite, recon, striker):
                self.assertTrue(node.url.startswith("tls://"), node.url)

    def test_with_only_the_links_that_there_are(self):
        with Fleet(PROGRAMS, namespaces(self), rights=RIGHTS) as fleet:  # without `insecure`
            self.run_story(fleet)

    def test_targets_are_found_as_without(self):
        with Fleet(PROGRAMS) as plain, Fleet(PROGRAMS, rights=RIGHTS) as secured:
            pace = ("--fps", "25", "--frames", "100") if PATIENCE <= 30 else ("--fps", "6", "--frames", "60")
            for recon in [fleet.recon([fleet.satellite()], *pace, "--deadline", "20000") for fleet in (plain, secured)]:
                self.assertEqual(recon.end(), 0)
                self.check_found(recon.all("report")[0]["data"])

    def test_the_script_shows_it(self):
        script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "jadc2")
        done = subprocess.run([sys.executable, "-B", script, "--programs", PROGRAMS, "--secured"], stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, timeout=120, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("strike1 offers strike at tls://", done.stdout)
        self.assertIn("is released by strike1", done.stdout)


class Rights(unittest.TestCase):
    def fleet(self, rights=RIGHTS):
        made = Fleet(PROGRAMS, rights=rights)
        self.addCleanup(made.close)
        return made

    def check_unused(self, striker):
        self.assertEqual(striker.pull("strike1:strike"), {"left": 4, "orders": []})

    def test_only_the_mission_centre_may_strike(self):
        striker = self.fleet({**RIGHTS, **OBSERVER}).striker()
        for member in ("recon", "recon-camera", "sat1", "operator", "observer"):
            for noun, said in (("strike1:strike", f"{member} may not send DELEGATE 'strike' to strike1"),
                               ("self:strike", "strike1 does not allow DELEGATE 'strike'")):
                done = striker.ask(member, "delegate", noun, "-d", order())
                self.assertEqual((done.returncode, done.stdout, done.stderr), (5, "", f"cles: denied: {said}\n"))
        self.check_unused(striker)
        done = striker.ask("mission", "delegate", "strike1:strike", "-d", order("o2"), "-o", "json")
        self.assertEqual((done.returncode, done.stdout), (6, ""))  # it may, but there is no target
        self.assertIn("strike1: its own sensor sees no target there", done.stderr)

    def test_the_right_alone_is_not_enough(self):
        striker = self.fleet().striker()  # a member signs only for a node that it names
        done = striker.ask("mission", "delegate", "self:strike", "-d", order())
        self.assertEqual((done.returncode, done.stdout, done.stderr),
                         (5, "", "cles: denied: strike1: 'strike' requires signed requests\n"))
        self.check_unused(striker)

    def fleet_of_two_keys(self, *arguments, **more):
        """A strike aircraft that needs a second key, and a mission centre."""
        fleet = self.fleet({**RIGHTS, "second": {"may": ["pull,push *:strike", *FINDS], "offers": []}})
        config = f"must_be_signed: true, must_be_confirmed: true, ledger: {fleet.folder}/orders"
        striker = fleet.striker(plugins=[f"{{path: {fleet.plugin('strike')}, config: {{{config}}}}}"])
        recon = fleet.recon([fleet.satellite()], "--fps", "30", "--deadline", "20000")
        mission = fleet.mission(recon, [striker], "--deadline", "20000", "--duration", "60", *arguments, **more)
        return fleet, striker, mission

    def held(self, striker):
        """The order that the aircraft holds; waits for it."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            if orders := striker.pull("strike1:strike").get("held"):
                return orders[0]
            time.sleep(0.05)
        return self.fail("no order is held")

    def test_a_second_member_confirms(self):
        fleet, striker, mission = self.fleet_of_two_keys()
        held = self.held(striker)
        self.assertEqual(held["requester"], "mission")
        word = json.dumps({"order": held["order"], "say": "confirm"})
        done = striker.ask("mission", "push", "strike1:strike", "-d", word)
        self.assertEqual((done.returncode, done.stdout), (5, ""))
        self.assertIn("an order is confirmed by another member than the one that has given it", done.stderr)
        done = striker.ask("second", "delegate", "strike1:strike", "-d", order())
        self.assertEqual(done.returncode, 5)  # it confirms orders, and gives none
        self.assertEqual(striker.pull("strike1:strike")["orders"], [])
        done = striker.ask("second", "push", "strike1:strike", "-d", word)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn(mission.end(), (0, 7), mission.events)
        with open(f"{fleet.folder}/orders", encoding="utf-8") as file:
            (released,) = [json.loads(line) for line in file]
        self.assertEqual((released["event"], released["requester"], released["confirmed_by"], released["what"]["id"]),
                         ("released", "mission", "second", held["order"]))
        self.assertEqual(released["what"]["picture"].split()[0], "sat1")

    def test_an_order_is_withdrawn_until_it_is_released(self):
        _, striker, mission = self.fleet_of_two_keys("--operator", stdin=subprocess.PIPE)
        mission.order_by_hand()
        held = self.held(striker)
        mission.process.stdin.write("abort\n")
        mission.process.stdin.flush()
        self.assertEqual(mission.wait_for("strike", "is aborted: by the operator")["data"]["order"], held["order"])
        self.assertEqual(mission.end(), 3, mission.events)
        self.assertEqual(mission.all("report")[0]["data"]["aborted"], 1)
        self.assertEqual(striker.pull("strike1:strike"), {"left": 4, "orders": []})

    def test_each_role_is_confined(self):
        fleet = self.fleet()
        satellite = fleet.satellite()
        recon = fleet.recon([satellite], "--fps", "1")
        video = '{"frames":"mission:video","width":320,"height":240,"format":"grey"}'
        for member, words, said in (
                ("mission", ("delegate", "sat1:FMV_Processing", "-d", "{}"),
                 "mission may not send DELEGATE 'FMV_Processing' to sat1"),
                ("strike1", ("delegate", "sat1:FMV_Processing", "-d", "{}"),
                 "strike1 may not send DELEGATE 'FMV_Processing' to sat1"),
                ("recon-camera", ("push", "sat1:FMV_Processing", "-d", "{}"),
                 "recon-camera may not send PUSH 'FMV_Processing' to sat1"),
                ("recon-camera", ("delegate", "sat1:FMV_Frame", "-d", "{}"),
                 "recon-camera may not send DELEGATE 'FMV_Frame' to sat1"),
                ("recon-camera", ("delegate", "sat1:FMV_Processing", "-d", video),
                 "sat1: frames: a noun of recon-camera"),  # the rights of sat1 are not for others to use
                ("recon", ("pull", "sat1:cles"), "recon may not send PULL 'cles' to sat1")):
            done = satellite.ask(member, *words)
            self.assertEqual((done.returncode, done.stdout, done.stderr), (5, "", f"cles: denied: {said}\n"))
        for member in ("recon-camera", "sat1", "strike1"):  # tracks are for the mission centre
            done = subprocess.run([fleet.program("cles"), "bind", "self:tracks", "--at", recon.url, "--keys",
                                   fleet.keys(member)], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                                  timeout=PATIENCE, check=False, env={**clean_environment(), "CLES_MULTICAST": "off"})
            self.assertEqual((done.returncode, done.stdout, done.stderr),
                             (5, "", "cles: denied: recon does not allow BIND 'tracks'\n"))

    def test_a_mission_centre_without_the_right(self):
        fleet = self.fleet({**RIGHTS, **OBSERVER})
        striker, recon = fleet.striker(), fleet.recon([fleet.satellite()], "--fps", "30")
        mission = fleet.mission(recon, [striker], "--duration", "60", key="observer")
        self.assertEqual(mission.end(), 3, mission.events)
        strike = mission.all("strike")[0]["data"]
        self.assertEqual((strike["fate"], strike["struck_by"]), ("refused", ""))
        self.assertRegex(strike["trouble"], "observer may not send DELEGATE 'strike' to strike1|may observer request it")
        self.check_unused(striker)

    def test_an_aircraft_that_must_not_process_video(self):
        rights = {**RIGHTS, "recon-camera": {"may": FINDS, "offers": []}}
        fleet = self.fleet(rights)
        recon = fleet.recon([fleet.satellite()])
        self.assertRegex(recon.wait_for("trouble", "sat1")["text"], r"and may recon-camera request it\?$")
        recon.stop(signal.SIGINT)
        self.assertEqual(recon.end(), 3)

    def test_a_satellite_that_must_not_get_the_video(self):
        fleet = self.fleet({**RIGHTS, "sat1": {**RIGHTS["sat1"], "may": FINDS}})
        recon = fleet.recon([fleet.satellite()])
        self.assertIn("denied: sat1 may not bind 'video' of recon-camera",
                      recon.wait_for("trouble", "the frames of recon-camera:video")["text"])
        recon.stop(signal.SIGINT)
        self.assertIn(recon.end(), (3, 5))  # 3: it was not found at first

    def test_outsiders_get_nothing(self):
        striker = self.fleet().striker()
        others = self.fleet()  # another fleet, with the same names
        with socket.create_connection(("127.0.0.1", striker.port), PATIENCE) as plain:
            plain.settimeout(PATIENCE)
            plain.sendall(f"DELEGATE self:strike {order()}\n".encode())
            self.assertNotIn(b"{", plain.recv(1000))
        code, out, err = run("drill", "--at", striker.url, "--keys", others.keys("mission"))
        self.assertEqual((code, out), (5, ""))
        self.assertRegex(err, "^cles-jadc2: cannot connect to .*: the other end('s key is not in the roster| refuses this node)")
        self.check_unused(striker)

    def test_a_drill_is_signed(self):
        fleet = self.fleet()
        striker = fleet.striker()
        code, out, err = run("drill", "--at", striker.url, "-n", "20", "--keys", fleet.keys("mission"))
        self.assertEqual((code, err), (0, ""))
        self.assertEqual(json.loads(out)["count"], 20)
        self.check_unused(striker)

    def test_a_load_is_sealed(self):
        fleet = self.fleet()
        satellite = fleet.satellite()
        code, out, err = run("load", "--at", satellite.url, "--streams", "1", "--duration", "0.5", "--keys",
                             fleet.keys("loader"))
        self.assertEqual((code, err), (0, ""))
        self.assertGreater(json.loads(out.splitlines()[-1])["frames"], 0)


class Usage(unittest.TestCase):
    def test_what_is_wrong_is_said(self):
        fleet = Fleet(PROGRAMS, rights={"recon": RIGHTS["recon"], "mission": RIGHTS["mission"]})
        self.addCleanup(fleet.close)
        recon, mission = fleet.keys("recon"), fleet.keys("mission")
        at = f"tls://127.0.0.1:{free_port()}"
        for code, said, arguments in (
                (2, f"--name x is not the name of the key in {mission}, which is mission",
                 ("mission", "--keys", mission, "--name", "x")),
                (2, f"the node for satellites has a key of its own, which is not in {recon}-camera: name its directory with "
                    "--camera-keys", ("recon", "--keys", recon)),
                (2, f"the node for satellites has a key of its own, which is not in {recon}-camera: name its directory with "
                    "--camera-keys", ("recon", "--keys", f"{recon}//")),
                (2, "--camera-keys: needs --keys too", ("recon", "--camera-keys", recon)),
                (5, "cannot open the folder /nowhere: No such file or directory", ("mission", "--keys", "/nowhere")),
                (5, "insecure_listen: 'tcp' is refused with security: use 'tls' instead of 'tcp://127.0.0.1:0'",
                 ("recon", "--keys", recon, "--camera-keys", mission, "--listen", "tcp://127.0.0.1:0")),
                (5, f"unknown_scheme: 'tls' in '{at}': it needs the key of a member: give --keys DIR, or set CLES_KEYS",
                 ("drill", "--at", at))):
            self.assertEqual(run(*arguments), (code, "", f"cles-jadc2: {said}\n"))

    def test_the_variable(self):
        with Fleet(PROGRAMS, rights=RIGHTS) as fleet:
            at = f"tls://127.0.0.1:{free_port()}"
            done = subprocess.run([fleet.program("cles-jadc2"), "mission", "--recon", at, "--strike", at, "--duration", "0.2"],
                                  stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False,
                                  env={**clean_environment(), "CLES_KEYS": fleet.keys("mission")})
        self.assertEqual((done.returncode, done.stderr), (3, ""))
        self.assertIn("mission: no tracks: ", done.stdout)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
