#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""cles access: whether a member may do something, and which line decides."""

import json
import unittest

from trust_support import Trust


class Access(Trust):
    def setUp(self):
        super().setUp()
        self.good("fleet", "init", "fleet", "--with", "car1,car2,sat1,relay")
        self.rights("sat1", "--may", "pull,bind *:localization", "--may", "push car1:target")
        self.rights("car2", "--offers", "pull *:localization")
        self.rights("relay", "--forwards", "sat*", "--may", "none")

    def rights(self, name, *options):
        self.good("fleet", "rights", name, *options, "-k", "fleet")
        self.good("keys", "join", "fleet/roster", "-k", "fleet/car1")

    def rules(self, text):
        self.path("fleet/car1/rules").write_text(text)

    def answer(self, *arguments, keys="fleet/car1"):
        done = self.run_in("access", *arguments, "-k", keys)
        as_json = self.run_in("access", *arguments, "-k", keys, "-o", "json")
        document = json.loads(as_json.out)
        self.assertEqual((done.code, as_json.code), (0, 0) if document["allowed"] else (5, 5))
        verdict = "allowed" if document["allowed"] else "denied"
        self.assertEqual(done.out, "\n  ".join([verdict, *document["lines"]]) + "\n")
        return [verdict, document["reason"], *document["lines"]]

    def test_rights_of_the_roster(self):
        self.assertEqual(self.answer("sat1", "push", "car1:target"),
                         ["allowed", "permitted", "roster, sat1 may: push car1:target", "roster, car1 offers: everything"])
        self.assertEqual(self.answer("sat1", "PULL", "car2:localization"),
                         ["allowed", "permitted", "roster, sat1 may: pull,bind *:localization",
                          "roster, car2 offers: pull *:localization"])
        self.assertEqual(self.answer("sat1", "delegate", "self:plan"),
                         ["denied", "may", "roster, sat1 may: not permitted by 'pull,bind *:localization', "
                          "'push car1:target'"])
        self.assertEqual(self.answer("sat1", "bind", "car2:localization"),
                         ["denied", "offers", "roster, sat1 may: pull,bind *:localization",
                          "roster, car2 offers: not permitted by 'pull *:localization'"])
        self.assertEqual(self.answer("relay", "pull", "car1:x"), ["denied", "may", "roster, relay may: nothing"])

    def test_members_only(self):
        self.assertEqual(self.answer("ghost", "pull", "car1:x"),
                         ["denied", "unknown_requester", "roster: ghost is not a member"])
        self.assertEqual(self.answer("sat1", "pull", "ghost:x"),
                         ["denied", "unknown_target", "roster: ghost is not a member"])
        self.assertEqual(self.answer("sat1", "pull", "car1:x", "--via", "ghost"),
                         ["denied", "unknown_forwarder", "roster: ghost is not a member"])

    def test_forwarding(self):
        self.assertEqual(self.answer("sat1", "push", "car1:target", "--via", "relay"),
                         ["allowed", "permitted", "roster, relay forwards: sat*", "roster, sat1 may: push car1:target",
                          "roster, car1 offers: everything"])
        self.assertEqual(self.answer("car2", "push", "car1:target", "--via", "relay"),
                         ["denied", "not_forwarded", "roster, relay forwards: sat*"])
        self.assertEqual(self.answer("sat1", "push", "car1:target", "--via", "car2"),
                         ["denied", "not_forwarded", "roster, car2 forwards: nothing"])

    def test_local_rules(self):
        self.rules("# nobody but sat1\nallow sat1 may push *:target\ndeny * may push *:target\ndeny car2 offers * *:*\n")
        self.assertEqual(self.answer("sat1", "push", "car1:target")[2:4],
                         ["rules, line 2: allow sat1 may push *:target", "roster, sat1 may: push car1:target"])
        self.assertEqual(self.answer("car2", "push", "car1:target"),
                         ["denied", "rule", "rules, line 3: deny * may push *:target"])
        self.assertEqual(self.answer("sat1", "pull", "car1:localization")[2], "rules: no line matches")
        # The node's own requests.
        self.assertEqual(self.answer("car1", "push", "sat1:target")[0], "allowed")
        self.assertEqual(self.answer("car1", "pull", "car2:localization"),
                         ["denied", "rule", "rules, line 4: deny car2 offers * *:*"])
        # What asks it for itself has arrived here.
        self.assertEqual(self.answer("car1", "push", "car1:target")[1], "rule")

    def test_broken_rules_deny_everything_but_what_is_exempt(self):
        self.rules("allow * may * *:*/**\nforbid sat1 may push *:target\n")
        self.assertEqual(self.answer("sat1", "push", "car1:target"),
                         ["denied", "rules_unreadable", "rules: everything is denied, because of an error: line 2: 'forbid "
                          "sat1 may push *:target': a rule begins with 'allow' or 'deny', not with 'forbid'"])
        self.rules("")
        self.path("fleet/car1/rules").chmod(0o666)
        self.assertIn("chmod go-w fleet/car1/rules", self.answer("sat1", "push", "car1:target")[2])
        for noun in ("car1:cles/roster", "car1:cles/cancel/5", "car1:cles/announced/x", "car1:cles/hello", "car1:cles/leaving",
                     "car1:cles/slots"):
            self.assertEqual(self.answer("sat1", "push", noun)[:2], ["allowed", "exempt"])

    def test_at_the_authority(self):
        self.assertEqual(self.answer("sat1", "push", "car1:target", keys="fleet")[:2], ["allowed", "permitted"])
        self.failed("access", "sat1", "push", "self:target", "-k", "fleet", says="fleet contains no key of a node")

    def test_parameters_are_compared_decoded(self):
        self.rights("sat1", "--may", "pull car1:log/a%2Fb")
        self.assertEqual(self.answer("sat1", "pull", "car1:log/%61%2fb")[0], "allowed")
        self.assertEqual(self.answer("sat1", "pull", "car1:log/a/b")[0], "denied")

    def test_usage(self):
        self.refused("access", says="peer")
        self.refused("access", "sat1", "push", says="noun")
        self.refused("access", "sat1", "fetch", "car1:x", says="fetch")
        self.refused("access", "sat 1", "push", "car1:x", says="'sat 1' is not the name of a node")
        self.refused("access", "sat1", "push", "car1", says="NODE:TASK")
        self.refused("access", "sat1", "push", "any:x", says="name the node that serves")
        self.refused("access", "sat1", "push", "car1:x", "--via", "a b", says="'a b' is not the name of a node")
        self.failed("access", "sat1", "push", "car1:x", "-k", "nowhere", says="cannot open the folder nowhere")
        self.path("empty").mkdir()
        self.failed("access", "sat1", "push", "car1:x", "-k", "empty", says="empty contains no roster")


if __name__ == "__main__":
    unittest.main()
