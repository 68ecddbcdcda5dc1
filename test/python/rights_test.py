#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Rosters, signatures, rights and certificates, against the project's test vectors."""

import base64
import json
import unittest
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

from cles import ed25519, fleet, grammar
from cles.confirmation import Confirmation
from cles.core import Core, Peer
from cles.errors import RefusedError
from cles.fleet import Member, Roster, key_in_certificate, may_forward, permits, read_roster
from cles.grammar import Request
from cles.reserved import Reserved
from cles.rights import Rights, parse_rules
from cles.signer import Signer

SECURITY = Path(__file__).parents[1] / "security"
VECTORS = json.loads((SECURITY / "vectors.json").read_text(encoding="utf-8"))
TABLE = json.loads((SECURITY / "access_table.json").read_text(encoding="utf-8"))
KEYS = {name: bytes.fromhex(key["public"]) for name, key in VECTORS["keys"].items()}


def roster_of(members):
    made = []
    for number, (name, told) in enumerate(members.items(), 1):
        made.append(Member(number, name, bytes([number]) * 32, Rights(told.get("may")), Rights(told.get("offers")),
                           tuple(filter(fleet.is_name_pattern, told.get("forwards", [])))))
    return Roster("", b"", 1, made)


class Access(unittest.TestCase):
    def test_it_decides_as_the_table_says(self):
        checked = 0
        for scenario in TABLE:
            roster, own = roster_of(scenario["members"]), scenario["self"]
            rules = parse_rules(scenario["rules"].encode())
            for row, letters in scenario["rows"].items():
                direction, requester, forwarder, verb = row.split(" ")
                if direction != "received":
                    continue
                for noun, letter in zip(scenario["nouns"], letters, strict=True):
                    parts = grammar.parse_noun(noun)
                    if parts.target != own:
                        continue
                    allowed = (forwarder == "-" or may_forward(roster, forwarder, requester)) and \
                        permits(roster, rules, own, requester, verb.upper(), parts)
                    self.assertEqual(allowed, letter in "PX", (scenario["members"], scenario["rules"], row, noun, letter))
                    checked += 1
        self.assertGreater(checked, 1000)


class Requesters(unittest.TestCase):
    """Access rules of the program know requester and forwarder, whatever they are asked about."""

    def setUp(self):
        self.asked = []
        self.core = Core("car1", lambda: 0)
        self.core.security = SimpleNamespace(refusal=lambda peer, request: None,
                                             requester=lambda peer, request: request.sender or peer.name)
        self.core.authorise = lambda access: self.asked.append((access.verb, access.requester, access.forwarded_by)) or True
        self.peer = Peer("tls", "tls://10.0.0.2", "car2")

    def test_of_a_request(self):
        for sender, expected in (("", ("car2", "")), ("car3", ("car3", "car2"))):
            asked = self.core.access(self.peer, Request("PULL", grammar.parse_noun("car1:speed"), sender=sender))
            self.assertEqual((asked.requester, asked.forwarded_by), expected)

    def test_of_nouns_that_are_listed(self):
        self.core.opened.add("pose")
        self.core.publish("pose", "{}")
        asked = Request("PULL", grammar.parse_noun("self:cles/nouns"), sender="car3")
        told = Reserved(self.core, 1000, by_datagram=False).serve(asked, self.peer)
        self.assertEqual(json.loads(told), {"nouns": ["pose"]})
        self.assertEqual(self.asked, [("BIND", "car3", "car2")])

    def test_nobody_has_proved_a_name_without_security(self):
        self.core.security = None
        asked = self.core.access(Peer("tcp", "tcp://10.0.0.2"), Request("PULL", grammar.parse_noun("car1:speed"), sender="car3"))
        self.assertEqual((asked.requester, asked.forwarded_by), ("", ""))


class Signatures(unittest.TestCase):
    def test_ed25519(self):
        # RFC 8032, 7.1, tests 2 and 3.
        for key, message, signature in (
                ("3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c", "72",
                 "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da"
                 "085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00"),
                ("fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025", "af82",
                 "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac"
                 "18ff9b538d16f290ae67f760984dc6594a7c15e9716ed28dc027beceea1ec40a")):
            key, message, signature = map(bytes.fromhex, (key, message, signature))
            self.assertTrue(ed25519.verify(key, message, signature))
            self.assertFalse(ed25519.verify(key, message + b"x", signature))
            self.assertFalse(ed25519.verify(key, message, signature[:-1] + b"\xff"))
            self.assertFalse(ed25519.verify(key, message, signature[:-1]))
            self.assertFalse(ed25519.verify(bytes(32), message, signature))

    def test_the_roster_of_the_vectors(self):
        line = VECTORS["roster"]
        for fleet_key in (KEYS["fleet"], None):
            roster = read_roster(line, fleet_key)
            self.assertEqual((roster.version, roster.by_name["car1"].key), (7, KEYS["car1"]))
        for wrong, says in ((line.replace('"version":7', '"version":8'), "not signed"), (line + " ", "is a line"),
                            (line[:-1], "is a line"), ("{}", "is a line"), (line.replace('{"signature', '{ "signature'), "is a line")):
            with self.assertRaisesRegex(RefusedError, says):
                read_roster(wrong, KEYS["fleet"])
        with self.assertRaisesRegex(RefusedError, "not signed"):
            read_roster(line, KEYS["car1"])

    def test_base64url_has_one_spelling(self):
        self.assertEqual(fleet.read_base64url(fleet.to_base64url(b"\xff" * 32), 32), b"\xff" * 32)
        text = fleet.to_base64url(b"\xff" * 32)
        for wrong in (text + "=", text[:-1] + "_", text[:-1], text.replace("_", "/"), 7, None, "ä" * 43):
            with self.assertRaises(RefusedError):
                fleet.read_base64url(wrong, 32)


class Signing(unittest.TestCase):
    def fleet_of(self, name):
        seed = bytes.fromhex(VECTORS["keys"][name]["seed"])
        text = base64.b64encode(bytes.fromhex("302e020100300506032b657004220420") + seed).decode()
        made = object.__new__(fleet.Fleet)
        made.name, made.roster = name, read_roster(VECTORS["roster"])
        made._signer = Signer(f"-----BEGIN PRIVATE KEY-----\n{text}\n-----END PRIVATE KEY-----\n".encode())
        return made

    def test_as_the_vectors(self):
        told = VECTORS["signed_update"]
        self.assertEqual(self.fleet_of("car2").sign_update(told["noun"], told["seq"], told["epoch"], told["body"]), told["sig"])
        told = VECTORS["signed_request"]
        self.assertEqual(self.fleet_of(told["requester"]).sign_request(
            told["node"], told["challenge"], told["verb"], told["noun"], told["body"], told["waits_ms"]), told["sig"])

    def test_what_is_no_key(self):
        with self.assertRaises(RefusedError):
            Signer(b"nothing")


class Updates(unittest.TestCase):
    """Which updates that another node passes on are believed."""

    def setUp(self):
        self.asked, self.got, self.counted = [], [], []
        made = SimpleNamespace(roster=read_roster(VECTORS["roster"]))
        self.now = 0
        self.confirmation = Confirmation(made, "car1", lambda: self.now, lambda *question: self.asked.append(question),
                                         lambda update: self.got.append(update.seq), self.counted.append)

    def admits(self, update):
        return self.confirmation.admits(grammar.parse_request(update))

    def signed(self):
        told = VECTORS["signed_update"]
        return f"UPDATE car2:localization seq={told['seq']} epoch={told['epoch']} sig={told['sig']} {told['body']}"

    def answer(self):
        told = VECTORS["announced"]
        return f'{{"announced":{told["announced"]},"seq":{told["seq"]},"epoch":"{told["epoch"]}","sig":"{told["sig_of_reply"]}"}}'

    def test_of_a_publisher_that_has_confirmed_its_epoch(self):
        challenge = fleet.read_base64url(VECTORS["announced"]["challenge"], 16)
        with patch("secrets.token_bytes", lambda _: challenge):
            self.assertFalse(self.admits(self.signed()))
            self.assertFalse(self.admits('UPDATE car2:localization seq=18 epoch=5f3a09c1 {"utc":3}'))  # without signature
            self.assertFalse(self.admits('UPDATE car2:speed seq=1 epoch=5f3a09c1 {"v":1}'))
            self.assertFalse(self.admits('UPDATE car2:speed seq=1 epoch=00000001 {"v":1}'))  # not confirmed
        self.assertEqual(len(self.asked), 1)
        self.assertFalse(self.confirmation.may_take_value("car2", "speed"))
        noun, answer = self.asked[0]
        self.assertEqual(noun, f"car2:cles/announced/{VECTORS['announced']['challenge']}")
        answer(self.answer())
        self.assertEqual(self.got, [17, 1])
        self.assertEqual(self.counted, ["updates_unsigned"] * 2)
        self.assertTrue(self.admits(self.signed()))
        self.assertFalse(self.admits(self.signed().replace('"utc":2', '"utc":4')))
        self.assertTrue(self.admits('UPDATE car2:speed seq=2 epoch=5f3a09c1 {"v":1}'))
        self.assertFalse(self.confirmation.may_take_value("car2", "localization"))
        self.assertTrue(self.confirmation.may_take_value("car2", "speed"))

    def test_answers_that_prove_nothing(self):
        for text in ("", "{}", self.answer().replace("car2", "car1"), self.answer()[:-1]):
            self.now += 2_000_000_000
            self.admits(self.signed())
            self.asked[-1][1](text)
        self.asked[-1][1](self.answer())  # of another challenge
        self.assertEqual(self.got, [])

    def test_of_the_node_at_the_other_end_and_of_strangers(self):
        self.assertTrue(self.admits('UPDATE car1:speed seq=2 epoch=00000001 {"v":1}'))
        self.assertFalse(self.admits('UPDATE car9:speed seq=2 epoch=00000001 {"v":1}'))
        self.assertEqual(self.asked, [])
        for n in range(200):
            self.admits(f'UPDATE car2:speed seq={n + 1} epoch=00000001 {{}}')
        self.assertLessEqual(len(self.confirmation._held), 64)
        self.assertEqual(len(self.asked), 1)


def der(tag, content):
    size = len(content)
    head = bytes([size]) if size < 128 else bytes([0x81, size]) if size < 256 else b"\x82" + size.to_bytes(2, "big")
    return bytes([tag]) + head + content


def certificate(key, subject=b"cles"):
    name = der(0x30, der(0x31, der(0x30, bytes.fromhex("0603550403") + der(0x0C, subject))))
    info = bytes.fromhex("302a300506032b6570032100") + key
    signed = der(0x30, der(0xA0, der(0x02, b"\x02")) + der(0x02, b"\x01") + der(0x30, bytes.fromhex("06032b6570")) + name +
                 der(0x30, b"") + name + info)
    return der(0x30, signed + der(0x30, bytes.fromhex("06032b6570")) + der(0x03, bytes(65)))


class Certificates(unittest.TestCase):
    def test_the_key_is_where_certificates_have_it(self):
        key, other = bytes(range(32)), b"\x07" * 32
        self.assertEqual(key_in_certificate(certificate(key)), key)
        decoy = bytes.fromhex("302a300506032b6570032100") + other
        self.assertEqual(key_in_certificate(certificate(key, subject=decoy + decoy)), key)
        good = certificate(key)
        for wrong in (b"", good[:50], good[:1] + b"\x80" + good[2:], good.replace(b"\x2b\x65\x70\x03\x21", b"\x2b\x65\x71\x03\x21")):
            with self.assertRaises(RefusedError):
                key_in_certificate(wrong)


if __name__ == "__main__":
    unittest.main()
