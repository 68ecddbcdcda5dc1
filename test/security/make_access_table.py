#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Writes access_table.json: rosters and rules, and what is allowed under each, as access_oracle.py decides it.

    make_access_table.py > access_table.json
"""

import json
import random

from access_oracle import VERBS, rows_of

NOUNS = [
    "car1:localization", "car1:localization/fast", "car1:target", "car1:target/5", "car1:plan", "car1:plan/a",
    "car1:plan/a/b", "car1:plan/a/b/c", "car1:log/a%2Fb", "car1:log/%61", "car1:log/a%2Ab", "car1:log/axb",
    "car1:log/%C3%A4", "car1:cles", "car1:cles/peers", "car1:cles/cancel/5", "car1:cles/roster",
    "car1:cles/announced/AAAAAAAAAAAAAAAAAAAAAA", "car1:cles/rosters", "car2:localization", "car2:cles/cancel/5",
    "car10:target", "sat1:plan/a", "sat1:target", "relay:target", "ghost:target",
]
PEERS = ["car1", "car2", "car10", "sat1", "relay", "ghost"]
FORWARDERS = ["", "relay", "sat1", "car2", "ghost"]


def scenario(members: dict, rules: str = "", own: str = "car1") -> dict:
    out = {"self": own, "members": members, "rules": rules, "peers": PEERS, "forwarders": FORWARDERS, "nouns": NOUNS}
    return out


EVERYBODY: dict = {name: {} for name in PEERS if name != "ghost"}
MIXED = {
    "car1": {"offers": ["pull,bind *:localization", "push car1:target", "* *:plan/**", "pull car1:log/*", "pull,bind *:cles"]},
    "car2": {"may": ["pull,bind *:localization", "push car1:target", "pull *:cles/*"], "forwards": ["car1*", "sat1"]},
    "car10": {"may": ["* car1:plan/a/**", "pull *:log/a%2Ab", "pull *:log/%61", "push c*1:t*t"], "offers": []},
    "sat1": {"may": [], "forwards": ["*"]},
    "relay": {"may": ["* *:*/**"], "forwards": ["sat*", "c**", "car1 ", "car2"]},
}
WRONG = {
    "car1": {"offers": ["* *:*/**"]},
    "car2": {"may": ["PULL *:localization", "pull  *:localization", " pull *:localization", "pull *:localization ",
                     "pull localization", "pull,, *:localization", ",pull *:localization", "pull, *:localization",
                     "*,pull *:localization", "** *:localization", "pull *:**", "pull **:localization", "pull self:plan",
                     "pull any:plan", "fetch *:plan", "pull *:plan/**/b", "pull *:plan/", "pull :plan", "pull *:", "",
                     "pull", "pull *:log/%6", "pull *:log/%FF", "pull *:log/%00", "pull *:log/%C3*%A4",
                     "pull *:a:b", "pull *:plan/a b"]},
    "car10": {"may": ["push *:plan/*/*", "pull *:log/*%C3%A4", "bind *:log/%2a", "delegate *:log/*%2A*", "update *:target"]},
    "sat1": {"may": ["bind *:*"], "offers": ["update,push *:target", "bind *:plan/*"]},
    "relay": {"forwards": ["c*1", "*0", "", "**"]},
}
RULES = """\
# Comments, empty lines and tabs are allowed.

allow\tsat* may  push car1:target   # the exception
deny sat* may push *:target
deny car* may * car1:plan/a/**\r
allow * may * *:plan/**
deny relay offers * *:*
deny car1 offers pull car1:log/a%2Ab
deny car1 may pull *:*"""
BROKEN = ["deny * may push target", "Deny * may push *:target", "deny * mays push *:target", "deny * may push",
          "deny * may push *:target *:target", "deny ** may push *:target", "deny self may push *:target",
          "allow * may push self:target", "deny * may push *:plan/**/a", "deny\v* may push *:target", "x # y"]


def random_scenario(seed: int) -> dict:
    dice = random.Random(seed)

    def name() -> str:
        return dice.choice(["*", "car*", "*1", "car1", "car2", "sat1", "s*1", "c*r*", "relay", "*a*", "**", "self"])

    def right() -> str:
        verbs = dice.choice(["*", "pull", "push,pull", "bind", "bind,update", "delegate,pull,bind", "Pull", "pull,"])
        task = dice.choice(["*", "target", "plan", "log", "cles", "localization", "l*", "*l*n", "*t"])
        parameters = dice.choice(["", "", "/*", "/**", "/a", "/a/**", "/*/b", "/a*b", "/%61", "/*%2A*", "/a/b/*", "/%2"])
        return f"{verbs} {name()}:{task}{parameters}"

    def rights() -> list:
        return [right() for _ in range(dice.randrange(5))]

    members = {}
    for each in PEERS[:-1]:
        members[each] = {key: rights() for key in ("may", "offers") if dice.random() < 0.6}
        members[each]["forwards"] = [name() for _ in range(dice.randrange(3))]
    rules = []
    while len(rules) < seed % 6:
        words = [dice.choice(["allow", "deny"]), name(), dice.choice(["may", "offers"]), right()]
        line = " ".join(words)
        if not any(wrong in line for wrong in ("**:", "** ", "self", "Pull", "pull, ", "/%2\0")) and not line.endswith("/%2"):
            rules.append(line)
    return scenario(members, "\n".join(rules) + "\n")


SCENARIOS = ([scenario(EVERYBODY), scenario(MIXED), scenario(WRONG), scenario(MIXED, RULES), scenario(EVERYBODY, RULES),
              scenario(WRONG, RULES, own="sat1"), scenario(MIXED, RULES, own="ghost")]
             + [random_scenario(seed) for seed in range(12)])
# Of rules with an error, a few nouns are enough.
SCENARIOS += [{**scenario(EVERYBODY, line + "\n"), "peers": ["car1", "car2"], "forwarders": ["", "relay"], "nouns": NOUNS[:2] + NOUNS[15:17]}
              for line in BROKEN]


def main() -> None:
    for each in SCENARIOS:
        each["rows"] = rows_of(each)
    print(json.dumps(SCENARIOS, indent=1))


if __name__ == "__main__":
    main()
