#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Each role of joint command is killed in turn: another node that offers its work takes over, or the failure is
reported; no target is struck twice, and each job has an outcome.

    losses_test.py PROGRAMS
"""

import re
import signal
import subprocess
import sys
import unittest

from jadc2_fleet import OLDEST_S, Fleet

PROGRAMS = sys.argv[1]


class Losses(unittest.TestCase):
    def setUp(self):
        self.fleet = Fleet(PROGRAMS).__enter__()
        self.addCleanup(lambda: self.fleet.__exit__(None, None, None))

    def frames_of(self, recon):
        recon.stop(signal.SIGINT)
        recon.end()
        frames = recon.all("report")[0]["data"]["frames"]
        self.assertEqual(frames["captured"], frames["done"] + frames["missing"] + frames["skipped"])
        return frames

    def recon(self, satellites, *arguments, **more):
        """One whose frames do not fail on a busy machine."""
        return self.fleet.recon(satellites, "--fps", "30", "--deadline", "20000", *arguments, **more)

    def mission_by_hand(self, recon, strikers, strikes=1, deadline=20000):
        """A mission centre that decides nothing until it is told to, so that a loss can occur before."""
        return self.fleet.mission(recon, strikers, "--operator", "--strikes", str(strikes), "--deadline", str(deadline),
                                  "--duration", "60", stdin=subprocess.PIPE)

    def check_orders(self, mission, **fates):
        every = {"given": 0, "done": 0, "refused": 0, "failed": 0, "unknown": 0, "open": 0, **fates}
        told = mission.all("report")[0]["data"]
        self.assertEqual({fate: told[fate] for fate in every}, every)
        self.assertEqual(told["done"], told["hit"] + told["missed"] + told["unseen"])

    # -- the satellite -----------------------------------------------------------------------------------------------------

    def test_another_satellite_goes_on(self):
        satellites = {"sat1": self.fleet.satellite("sat1"), "sat2": self.fleet.satellite("sat2")}
        striker = self.fleet.striker()
        recon = self.recon(list(satellites.values()))
        mission = self.mission_by_hand(recon, [striker])
        first = recon.wait_for("processing")["text"].split()[0]
        mission.wait_for("bound")
        satellites.pop(first).kill()
        (other,) = satellites
        told = recon.wait_for("processing", f"{other} processes the video")["text"]
        first_frame, missing = map(int, re.search(r"from frame (\d+) on; (\d+) before it are missing$", told).groups())
        self.assertLess(missing, first_frame)  # it goes on
        mission.order_by_hand(by=other)
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        self.assertEqual(mission.all("strike")[0]["data"]["processed_by"], other)
        self.check_orders(mission, given=1, done=1)
        frames = self.frames_of(recon)
        self.assertEqual(frames["nodes"], [first, other])
        self.assertGreaterEqual(frames["missing"], missing)

    def test_without_another_it_shows_and_goes_on_when_it_is_back(self):
        satellite, striker = self.fleet.satellite(), self.fleet.striker()
        recon = self.recon([satellite])
        mission = self.mission_by_hand(recon, [striker])
        recon.wait_for("processing")
        mission.wait_for("bound")
        satellite.kill()
        recon.wait_for("trouble", "no processing: ")
        mission.wait_for("trouble", "no node processes the video of recon: ")
        self.fleet.satellite("sat1", port=satellite.port)
        mission.wait_for("processing", "sat1 processes the video")
        mission.order_by_hand()
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        self.check_orders(mission, given=1, done=1)
        frames = self.frames_of(recon)
        self.assertGreater(frames["missing"], 0)

    def test_a_plugin_in_a_process_of_its_own_processes_the_video(self):
        plugin = f"{{path: {self.fleet.plugin('fmv')}, isolation: process, config: {{streams: 1}}}}"
        satellite = self.fleet.satellite(plugins=[plugin])
        recon = self.recon([satellite])
        recon.wait_for("processing", "sat1 processes the video")
        frames = self.frames_of(recon)
        self.assertEqual(frames["nodes"], ["sat1"])
        self.assertGreaterEqual(satellite.pull("sat1:FMV_Processing")["frames"], frames["done"])

    def test_a_satellite_that_hangs_costs_no_more_than_a_deadline(self):
        satellites = {"sat1": self.fleet.satellite("sat1"), "sat2": self.fleet.satellite("sat2")}
        recon = self.fleet.recon(list(satellites.values()), "--fps", "30", "--deadline", "300")
        first = recon.wait_for("processing")["text"].split()[0]
        satellites[first].send_signal(signal.SIGSTOP)
        recon.wait_for("trouble", "deadline")
        recon.wait_for("processing", next(name for name in satellites if name != first))
        satellites[first].send_signal(signal.SIGCONT)
        self.assertGreater(self.frames_of(recon)["failures"]["deadline"], 0)

    # -- the reconnaissance aircraft ---------------------------------------------------------------------------------------

    def test_the_mission_centre_sees_that_recon_is_lost_and_back(self):
        satellite, striker = self.fleet.satellite(), self.fleet.striker()
        recon = self.recon([satellite])
        mission = self.mission_by_hand(recon, [striker])
        recon.wait_for("processing")
        mission.wait_for("bound")
        recon.kill()
        mission.wait_for("trouble", "recon is lost: ")
        self.recon([satellite], listen=recon.url)
        mission.wait_for("rebound", "recon is back")
        mission.order_by_hand()
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        self.check_orders(mission, given=1, done=1)
        self.assertEqual(satellite.stop(), 0)
        self.assertEqual(striker.stop(), 0)

    def test_a_silent_feed_is_shown_and_its_tracks_are_not_struck(self):
        satellite, striker = self.fleet.satellite(), self.fleet.striker()
        recon = self.recon([satellite])
        mission = self.mission_by_hand(recon, [striker])
        targets = []
        while not targets:
            picture = mission.wait_for("picture", after=mission.told())
            targets = picture["data"]["tracks"]
        recon.send_signal(signal.SIGSTOP)
        shown = mission.wait_for("silent", "recon is silent for ")
        while picture["data"]["captured"] + OLDEST_S + 1 > shown["utc"]:  # until it is too old
            shown = mission.wait_for("silent", after=mission.told())
            picture = mission.all("picture")[-1]
        self.assertRegex(shown["text"], r"^recon is silent for \d+\.\d s: its tracks are \d+\.\d s old$")
        for target in picture["data"]["tracks"]:
            mission.process.stdin.write(f"strike {target['id']}\n")
        mission.process.stdin.flush()
        mission.wait_for("operator", f" s old: {OLDEST_S}.0 at most")
        recon.send_signal(signal.SIGCONT)
        heard = mission.wait_for("heard", "recon is not silent any more")
        # A track whose place was predicted over the pause has been given up or corrected a second later.
        mission.order_by_hand(since=heard["utc"] + 1)
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        self.assertEqual(len(striker.pull("strike1:strike")["orders"]), 1)

    # -- the strike aircraft -----------------------------------------------------------------------------------------------

    def test_another_strike_aircraft_is_asked_where_one_is_gone(self):
        satellite = self.fleet.satellite()
        strikers = [self.fleet.striker("strike1"), self.fleet.striker("strike2")]
        mission = self.mission_by_hand(self.recon([satellite]), strikers)
        mission.wait_for("bound")
        strikers[0].kill()
        mission.order_by_hand()
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        self.assertEqual(mission.all("strike")[0]["data"]["struck_by"], "strike2")
        self.assertEqual(len(strikers[1].pull("strike2:strike")["orders"]), 1)

    def test_an_aircraft_that_refuses_connections_has_refused(self):
        striker = self.fleet.striker()
        mission = self.strike_by_hand([striker], strikes=2, deadline=3000)
        striker.kill()
        mission.order_by_hand()
        self.assertIn(mission.end(), (3, 7), mission.events)  # 7: the first one has missed
        self.assertEqual([one["data"]["fate"] for one in mission.all("strike")], ["done", "refused"])
        self.check_orders(mission, given=2, done=1, refused=1)

    def test_an_aircraft_that_is_out_of_range_leaves_it_to_another(self):
        far = f"{{path: {self.fleet.plugin('strike')}, config: {{lat: 34.2}}}}"  # 111 km away
        strikers = [self.fleet.striker("strike1", [far]), self.fleet.striker("strike2")]
        mission = self.fleet.mission(self.recon([self.fleet.satellite()]), strikers, "--strikes", "2", "--deadline", "20000",
                                     "--duration", "60")
        self.assertIn(mission.end(), (0, 7), mission.events)
        self.assertEqual({one["data"]["struck_by"] for one in mission.all("strike")}, {"strike2"})
        self.assertEqual(strikers[0].pull("strike1:strike")["orders"], [])

    def test_an_aircraft_that_starts_again_knows_what_it_has_done(self):
        ledger = f"{self.fleet.folder}/orders"
        plugin = f"{{path: {self.fleet.plugin('strike')}, config: {{ledger: {ledger}, weapons: 2}}}}"
        striker = self.fleet.striker(plugins=[plugin])
        mission = self.strike_by_hand([striker])
        self.assertIn(mission.end(), (0, 7), mission.events)
        before = striker.pull("strike1:strike")
        self.assertEqual(before["left"], 1)
        striker.kill()
        striker = self.fleet.striker(plugins=[plugin])
        self.assertEqual(striker.pull("strike1:strike"), before)

    def test_an_aircraft_without_weapons_leaves_it_to_another(self):
        satellite = self.fleet.satellite()
        strikers = [self.fleet.striker("strike1", [f"{{path: {self.fleet.plugin('strike')}, config: {{weapons: 0}}}}"]),
                    self.fleet.striker("strike2")]
        mission = self.fleet.mission(self.recon([satellite]), strikers, "--strikes", "2", "--deadline", "20000",
                                     "--duration", "60")
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        self.assertEqual({one["data"]["struck_by"] for one in mission.all("strike")}, {"strike2"})
        self.assertEqual(strikers[0].pull("strike1:strike")["orders"], [])

    def strike_by_hand(self, strikers, **more):
        """A mission centre whose operator has ordered one strike, which is done: so it knows which aircraft strikes."""
        mission = self.mission_by_hand(self.recon([self.fleet.satellite()]), strikers, **more)
        mission.order_by_hand()
        self.assertEqual(mission.wait_for("strike")["data"]["fate"], "done")
        return mission

    def test_an_order_whose_answer_is_lost_is_not_given_again(self):
        strikers = [self.fleet.striker("strike1"), self.fleet.striker("strike2")]
        mission = self.strike_by_hand(strikers, strikes=2)
        first = mission.all("strike")[0]["data"]
        before = [first["order"]] if first["struck_by"] == "strike2" else []
        mission.order_by_hand(stopped=strikers)
        strikers[0].kill()
        strikers[1].send_signal(signal.SIGCONT)
        code = mission.end()
        self.assertEqual(len(mission.all("strike")), 2)
        second = mission.all("strike")[1]["data"]
        carried_out = strikers[1].pull("strike2:strike")["orders"]
        if second["fate"] == "unknown":  # it was the first one's
            self.assertEqual((code, carried_out), (4, before))
            self.check_orders(mission, given=2, done=1, unknown=1)
        else:
            self.assertEqual((second["fate"], second["struck_by"]), ("done", "strike2"))
            self.assertIn(code, (0, 7))
            self.assertEqual(carried_out, sorted([*before, second["order"]]))
            self.check_orders(mission, given=2, done=2)

    def test_an_aircraft_that_hangs_leaves_the_fate_unknown(self):
        striker = self.fleet.striker()
        mission = self.strike_by_hand([striker], strikes=2, deadline=3000)
        mission.order_by_hand(stopped=[striker])
        self.assertEqual(mission.end(), 4, mission.events)
        self.assertEqual([one["data"]["fate"] for one in mission.all("strike")], ["done", "unknown"])
        self.check_orders(mission, given=2, done=1, unknown=1)
        striker.send_signal(signal.SIGCONT)
        self.assertLessEqual(len(striker.pull("strike1:strike")["orders"]), 2)

    def test_an_aircraft_that_is_killed_meanwhile_leaves_the_fate_unknown(self):
        striker = self.fleet.striker()
        mission = self.strike_by_hand([striker], strikes=2)
        mission.order_by_hand(stopped=[striker])
        striker.kill()
        self.assertEqual(mission.end(), 4, mission.events)
        self.check_orders(mission, given=2, done=1, unknown=1)

    # -- the mission centre ------------------------------------------------------------------------------------------------

    def test_a_new_mission_centre_takes_over(self):
        satellite, striker = self.fleet.satellite(), self.fleet.striker()
        recon = self.recon([satellite])
        first = self.fleet.mission(recon, [striker], "--strikes", "2", "--duration", "60")
        order = first.wait_for("strike")["data"]
        first.wait_for("assessed")  # recon knows which target was attacked
        first.kill()
        self.assertEqual(order["fate"], "done")
        second = self.fleet.mission(recon, [striker], "--duration", "60")
        self.assertIn(second.end(), (0, 7), second.events)
        orders = striker.pull("strike1:strike")["orders"]
        self.assertIn(order["order"], orders)
        self.assertIn(second.all("strike")[0]["data"]["order"], orders)
        self.assertEqual(len(orders), len(set(orders)))
        self.assertLessEqual(set(self.frames_of(recon)["failures"]), {"no_target"}, recon.events)  # before it was found

    def test_an_operator_who_goes_leaves_no_more_than_what_is_open(self):
        striker = self.fleet.striker()
        mission = self.strike_by_hand([striker], strikes=3)
        mission.order_by_hand(stopped=[striker])
        mission.process.stdin.close()
        mission.wait_for("operator", "the operator has left: ")
        striker.send_signal(signal.SIGCONT)
        self.assertIn(mission.end(), (0, 7), mission.events)  # one of 200 misses
        self.check_orders(mission, given=2, done=2)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
