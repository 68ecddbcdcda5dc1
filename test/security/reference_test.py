#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""The formats of docs/protocol_security.md: the test vectors hold, and everything that the page refuses is refused.

    reference_test.py [unittest options]
"""

import json
import random
import sys
import unittest
from pathlib import Path

from reference_or_skip import r, sodium

HERE = Path(__file__).resolve().parent
VECTORS = json.loads((HERE / "vectors.json").read_text())


def identity(name: str) -> r.Identity:
    return r.Identity(bytes.fromhex(VECTORS["keys"][name]["seed"]))


FLEET, CAR1, CAR2 = identity("fleet"), identity("car1"), identity("car2")


class Keys(unittest.TestCase):
    def test_public_keys_follow_from_the_seeds(self):
        for name, who in (("fleet", FLEET), ("car1", CAR1), ("car2", CAR2)):
            self.assertEqual(who.public.hex(), VECTORS["keys"][name]["public"])
            self.assertEqual(who.dh_public.hex(), VECTORS["keys"][name]["x25519_public"])

    def test_the_fingerprint_is_of_name_and_key(self):
        self.assertEqual(r.fingerprint("car1", CAR1.public), VECTORS["fingerprint"])
        self.assertNotEqual(r.fingerprint("car2", CAR1.public), VECTORS["fingerprint"])

    def test_a_value_has_one_spelling(self):
        self.assertEqual(r.binary("AAE", 2), b"\x00\x01")
        for wrong in ("AAF", "AAE=", "AA+", "AAEA", "", "A", " AAE", None):
            with self.assertRaises(r.Refused, msg=repr(wrong)):
                r.binary(wrong, 2)


class Roster(unittest.TestCase):
    line = VECTORS["roster"].encode()

    def content(self) -> dict:
        return json.loads(self.line)["roster"]

    def refuse(self, roster) -> None:
        with self.assertRaises(r.Refused):
            r.read_roster(r.sign_roster(FLEET, roster), FLEET.public)

    def test_it_is_read_and_its_keys_are_for_the_members(self):
        roster = r.read_roster(self.line, FLEET.public)
        self.assertEqual((roster["version"], roster["generation"], roster["oldest"]), (7, 5, 4))
        self.assertEqual([member["name"] for member in roster["members"]], ["car1", "car2"])
        expected = tuple(bytes.fromhex(VECTORS["group_keys"][which]) for which in ("current", "next"))
        sealed = [roster["keys"]] + [member["keys"] for member in roster["members"]]
        for receiver, box in zip((FLEET, CAR1, CAR2), sealed):
            self.assertEqual(r.group_keys(box, receiver), expected)
        with self.assertRaises(r.Refused):
            r.group_keys(sealed[1], CAR2)

    def test_no_bit_of_it_can_be_changed(self):
        for place in range(len(self.line)):
            for bit in range(8):
                changed = bytearray(self.line)
                changed[place] ^= 1 << bit
                with self.assertRaises(r.Refused):
                    r.read_roster(bytes(changed), FLEET.public)

    def test_nothing_stands_around_it(self):
        for wrong in (b" " + self.line, self.line + b"\n", self.line + b" ", self.line[:-1], b"{}", b""):
            with self.assertRaises(r.Refused):
                r.read_roster(wrong, FLEET.public)

    def test_it_has_a_longest_length(self):
        roster = {**self.content(), "colour": ""}
        roster["colour"] = "r" * (r.ROSTER_LIMIT - len(r.sign_roster(FLEET, roster)))
        r.read_roster(r.sign_roster(FLEET, roster), FLEET.public)
        self.refuse({**roster, "colour": roster["colour"] + "r"})

    def test_a_line_has_exactly_one_form(self):
        def signed(content: str, before: str = "", after: str = "") -> bytes:
            signature = r.text(FLEET.sign(b"cles roster 1\n" + content.encode()))
            return (before + '{"signature":"' + signature + '","roster":' + content + "}" + after).encode()

        content = json.dumps(self.content(), separators=(",", ":"))
        r.read_roster(signed(content), FLEET.public)
        for line in (signed(" " + content), signed(content + " "), signed("[" + content + "]"), signed(content, before=" "),
                     signed(content, after="\n"), signed(content.replace(",", ",\n", 1))):
            with self.assertRaises(r.Refused, msg=line):
                r.read_roster(line, FLEET.public)

    def test_json_is_strict(self):
        content = json.dumps(self.content(), separators=(",", ":"))
        for value, accepted in (("[" * 31 + "]" * 31, True), ("[" * 32 + "]" * 32, False), ("[" * 5000 + "]" * 5000, False),
                                ("-0", True), ("NaN", False), ('"\\ud800"', False), ('"\\ud83d\\ude00"', True), ("07", False)):
            changed = '{"x":' + value + "," + content[1:]
            signature = r.text(FLEET.sign(b"cles roster 1\n" + changed.encode()))
            line = ('{"signature":"' + signature + '","roster":' + changed + "}").encode()
            if accepted:
                r.read_roster(line, FLEET.public)
            else:
                with self.assertRaises(r.Refused, msg=value):
                    r.read_roster(line, FLEET.public)
        empty = json.dumps({**self.content(), "members": [], "last": 0}).replace('"last": 0', '"last": -0')
        signature = r.text(FLEET.sign(b"cles roster 1\n" + empty.encode()))
        with self.assertRaises(r.Refused):
            r.read_roster(('{"signature":"' + signature + '","roster":' + empty + "}").encode(), FLEET.public)

    def test_another_fleet_is_refused(self):
        with self.assertRaises(r.Refused):
            r.read_roster(self.line, CAR1.public)
        self.refuse({**self.content(), "fleet": r.text(CAR1.public)})

    def test_unknown_keys_are_ignored_unless_they_must_be_understood(self):
        roster = {**self.content(), "colour": "red"}
        r.read_roster(r.sign_roster(FLEET, roster), FLEET.public)
        self.refuse({**roster, "must_wait": 1})
        roster["members"][0]["must_wait"] = 1
        self.refuse(roster)

    def test_a_key_occurs_once(self):
        content = json.dumps(self.content(), separators=(",", ":"))
        for twice in (content.replace('{"fleet"', '{"version":9,"fleet"', 1), content.replace('"number":1,', '"number":1,"number":1,')):
            signed = r.text(FLEET.sign(b"cles roster 1\n" + twice.encode()))
            with self.assertRaises(r.Refused):
                r.read_roster(('{"signature":"' + signed + '","roster":' + twice + "}").encode(), FLEET.public)

    def test_numbers_are_whole_and_in_range(self):
        for key, values in {
            "version": (0, -1, 2**32, 1.0, True, "7", None),
            "last": (-1, 2, 2**24, None),  # a member has the number 3
            "generation": (0, 2**32 - 1, None),
            "oldest": (0, 3, 6, None),
        }.items():
            for value in values:
                self.refuse({**self.content(), key: value})

    def test_members_are_in_order_and_distinct(self):
        def with_member(change):
            roster = self.content()
            change(roster["members"])
            return roster

        self.refuse(with_member(lambda members: members.reverse()))
        self.refuse(with_member(lambda members: members[1].update(number=1)))
        self.refuse(with_member(lambda members: members[0].update(number=0)))
        self.refuse(with_member(lambda members: members[1].update(name="car1")))
        self.refuse(with_member(lambda members: members[1].update(key=members[0]["key"])))
        for key in (bytes(32), b"\x01" + bytes(31), b"\xff" * 32, b"\xec" + b"\xff" * 30 + b"\x7f"):  # of low order, no point
            self.refuse(with_member(lambda members, key=key: members[1].update(key=r.text(key))))
        for key in ("number", "name", "key", "keys"):
            self.refuse(with_member(lambda members, key=key: members[0].pop(key)))
        for name in ("", "self", "any", "all", "car 1", "c" * 65, 1):
            self.refuse(with_member(lambda members, name=name: members[0].update(name=name)))
        for rights in ("pull *:*", [1], {}):
            self.refuse(with_member(lambda members, rights=rights: members[0].update(may=rights)))
        self.refuse({**self.content(), "members": {}})
        self.refuse({**self.content(), "members": [1]})


class Handshake(unittest.TestCase):
    def test_it_is_noise(self):
        """The known answer of the vectors of Cacophony for this protocol (github.com/haskell-cryptography/cacophony)."""
        ends = []
        for initiator, static, ephemeral, remote in (
            (True, "e61ef9919cde45dd5f82166404bd08e38bceb5dfdfded0a34c8df7ed542214d1",
             "893e28b9dc6ca8d611ab664754b8ceb7bac5117349a4439a6b0569da977c464a",
             "31e0303fd6418d2f8c0e78b91f22e8caed0fbe48656dcf4767e4834f701b8f62"),
            (False, "4a3acbfdb163dec651dfa3194dece676d437029c62a408b4c5ea9114246e4893",
             "bbdb4cdbd309f1a1f2e1456967fe288cadd6f712d65dc7b7793d5e63da6b375b",
             "6bc3822a2aa7f4e6981d6538692b3cdf3e6df9eea6ed269eb41d93c22757b75a"),
        ):
            me = r.Identity(bytes(32))
            me.dh_secret = bytes.fromhex(static)
            me.dh_public = sodium.crypto_scalarmult_base(me.dh_secret)
            original, r.x25519_of = r.x25519_of, bytes  # its static keys are X25519 keys already
            try:
                ends.append(r.Handshake(me, bytes.fromhex(remote), initiator, b"John Galt", bytes.fromhex(ephemeral)))
            finally:
                r.x25519_of = original
        first, second = ends
        message = first.write(b"Ludwig von Mises")
        self.assertEqual(message.hex(), "ca35def5ae56cec33dc2036731ab14896bc4c75dbb07a61f879f8e3afa4c7944"
                                        "0177015efc1fe7a37c629af7120a96274e6ab7afcc9261901d0e09ae32a5bb96")
        self.assertEqual(second.read(message), b"Ludwig von Mises")
        message = second.write(b"Murray Rothbard")
        self.assertEqual(message.hex(), "95ebc60d2b1fa672c1f46a8aa265ef51bfe38e7ccb39ec5be34069f144808843"
                                        "b274d3429adc47ca093ba63ef90f8da89fda108db471dccfa4894aa7b00003")
        self.assertEqual(first.read(message), b"Murray Rothbard")
        self.assertEqual(first.hash.hex(), "24c6b51ecb76277140ca018b5985bc9f03de321dae2d34dcae433dafef0131d9")
        sending, receiving = first.split()
        self.assertEqual(r.encrypt(sending, 0, b"", b"F. A. Hayek").hex(),
                         "966b05bc69ec01b8454d3160a214e6f24a3d884eb31ec2408af63f")
        self.assertEqual(r.encrypt(receiving, 0, b"", b"Carl Menger").hex(),
                         "0ad887fba4f611bbb4afe44ba3556b8164332ca7d5934634d63d80")

    def ends(self, **changes):
        given = {"fleet": FLEET.public, "number": 3, "head": None, "initiator": CAR1, "expected": CAR1.public, **changes}
        vector = VECTORS["handshake"]
        ephemerals = [bytes.fromhex(secret) for secret in vector["ephemeral_secrets"]]
        start = bytes.fromhex(vector["hello"])[:12]
        first = r.Handshake(given["initiator"], CAR2.public, True, r.prologue(FLEET.public, 3, start), ephemerals[0])
        seen = r.prologue(given["fleet"], given["number"], given["head"] or start)
        return first, r.Handshake(CAR2, given["expected"], False, seen, ephemerals[1])

    def test_the_vector_holds(self):
        vector = VECTORS["handshake"]
        hello, welcome = bytes.fromhex(vector["hello"]), bytes.fromhex(vector["welcome"])
        self.assertEqual((len(hello), len(welcome)), (100, 100))
        first, second = self.ends()
        self.assertEqual(vector["prologue"], r.prologue(FLEET.public, 3, hello[:12]).hex())
        payload = second.read(hello[12:])
        self.assertEqual(payload[:8], bytes(8))
        self.assertEqual(int.from_bytes(payload[8:12], "big"), 7)
        self.assertEqual(payload[12:16].hex(), "0a0b0c0d")
        self.assertEqual(int.from_bytes(payload[32:], "big"), 41)
        self.assertEqual(first.write(payload), hello[12:])
        answer = first.read(welcome[12:])
        self.assertEqual(second.write(answer), welcome[12:])
        self.assertEqual(answer[16:32].hex(), VECTORS["group"]["salt"])
        self.assertEqual(first.hash.hex(), vector["hash"])
        self.assertEqual(first.hash, second.hash)
        self.assertEqual(first.split(), second.split()[::-1])
        self.assertEqual([key.hex() for key in first.split()],
                         [vector["initiator_sends_with"], vector["responder_sends_with"]])

    def test_the_mac_of_the_vector_holds(self):
        hello = bytes.fromhex(VECTORS["handshake"]["hello"])
        mac = bytes.fromhex(VECTORS["handshake"]["hello_mac"])
        self.assertEqual(r.hello_mac(CAR1, CAR2.public, FLEET.public, 1, 3, hello), mac)
        self.assertEqual(r.hello_mac(CAR2, CAR1.public, FLEET.public, 1, 3, hello), mac)
        for datagram in (hello, hello + mac):
            self.assertEqual(r.read_hello(CAR2, 3, CAR1.public, FLEET.public, datagram), hello)

    def test_another_mac_is_refused(self):
        hello = bytes.fromhex(VECTORS["handshake"]["hello"])
        mac = bytes.fromhex(VECTORS["handshake"]["hello_mac"])
        wrong = [hello + mac[:-1], hello + mac + b"x", mac, hello[:-1]]
        for place in range(1, len(hello + mac)):
            changed = bytearray(hello + mac)
            changed[place] ^= 1 << random.randrange(8)
            wrong.append(bytes(changed))
        for datagram in wrong:
            with self.assertRaises(r.Refused):
                r.read_hello(CAR2, 3, CAR1.public, FLEET.public, datagram)
        for ends in ((CAR2, 1, CAR1.public, FLEET.public), (CAR2, 3, FLEET.public, FLEET.public),
                     (FLEET, 3, CAR1.public, FLEET.public), (CAR2, 3, CAR1.public, CAR1.public)):
            with self.assertRaises(r.Refused):
                r.read_hello(*ends, hello + mac)

    def test_who_else_sends_hello_is_refused(self):
        hello = bytes.fromhex(VECTORS["handshake"]["hello"])
        other = bytearray(hello[:12])
        other[11] ^= 1
        for changes in ({"fleet": CAR1.public}, {"number": 1}, {"head": bytes(other)}, {"expected": FLEET.public}):
            with self.assertRaises(r.Refused, msg=str(changes)):
                self.ends(**changes)[1].read(hello[12:])
        impostor, honest = self.ends(initiator=FLEET)
        with self.assertRaises(r.Refused):
            honest.read(impostor.write(r.hello_payload(7, "0a0b0c0d", bytes(16), 0)))

    def test_no_bit_of_it_can_be_changed(self):
        for which in ("hello", "welcome"):
            message = bytes.fromhex(VECTORS["handshake"][which])
            for place in range(12, len(message)):
                changed = bytearray(message)
                changed[place] ^= 1 << random.randrange(8)
                first, second = self.ends()
                with self.assertRaises(r.Refused):
                    if which == "hello":
                        second.read(bytes(changed[12:]))
                    else:
                        first.write(r.hello_payload(7, "0a0b0c0d", bytes(16), 0))
                        first.read(bytes(changed[12:]))

    def test_a_key_of_low_order_is_refused(self):
        with self.assertRaises(r.Refused):
            self.ends()[1].read(bytes(32) + bytes(56))


class Datagrams(unittest.TestCase):
    def keys(self):
        vector = VECTORS["handshake"]
        return {"car1": bytes.fromhex(vector["initiator_sends_with"]), "car2": bytes.fromhex(vector["responder_sends_with"])}

    def test_data_is_opened(self):
        for vector in VECTORS["data"]:
            key, datagram = self.keys()[vector["from"]], bytes.fromhex(vector["datagram"])
            self.assertEqual(r.open_data(key, datagram), vector["line"].encode())
            number = {"car1": 1, "car2": 3}[vector["from"]]
            self.assertEqual(r.seal_data(key, number, datagram[4:12], vector["counter"], vector["line"].encode()), datagram)

    def test_group_is_opened(self):
        vector = VECTORS["group"]
        key = bytes.fromhex(VECTORS["group_keys"]["current"])
        datagram = bytes.fromhex(vector["datagram"])
        self.assertEqual(r.open_group(key, datagram), vector["line"].encode())
        self.assertEqual(r.seal_group(key, 3, vector["generation"], bytes.fromhex(vector["salt"]), vector["counter"],
                                      vector["line"].encode()), datagram)
        with self.assertRaises(r.Refused):
            r.open_group(bytes.fromhex(VECTORS["group_keys"]["next"]), datagram)

    def open_pool(self, sealed: bytes, key="current", sender=CAR2, **changes) -> bytes:
        vector = {**VECTORS["pool"], **changes}
        return r.open_pool(bytes.fromhex(VECTORS["group_keys"][key]), FLEET.public, sender.public, vector["subject"],
                           vector["reply"], sealed)

    def test_messages_through_nats_are_opened(self):
        vector = VECTORS["pool"]
        salt, sealed = bytes.fromhex(vector["salt"]), bytes.fromhex(vector["sealed"])
        self.assertEqual(self.open_pool(sealed), vector["message"].encode())
        self.assertEqual(r.seal_pool(bytes.fromhex(VECTORS["group_keys"]["current"]), FLEET.public, CAR2, 3,
                                     vector["generation"], salt, vector["counter"], vector["subject"], vector["reply"],
                                     vector["message"].encode()), sealed)
        self.assertEqual(r.instance(3, salt), int(vector["instance"], 16))
        for changes in ({"key": "next"}, {"sender": CAR1}, {"subject": "x"}, {"reply": ""}, {"reply": "a\nb"}):
            with self.assertRaises(r.Refused, msg=str(changes)):
                self.open_pool(sealed, **changes)
        for place in range(len(sealed)):
            with self.assertRaises(r.Refused):
                self.open_pool(sealed[:place])
            for bit in range(8):
                changed = bytearray(sealed)
                changed[place] ^= 1 << bit
                with self.assertRaises(r.Refused):
                    self.open_pool(bytes(changed))

    def test_a_session_of_two_bridges_begins(self):
        vector = VECTORS["pool_session"]
        instances = [int(each, 16) for each in vector["instances"]]
        index, first = r.read_session_question("hello", vector["hello"])
        again, second = r.read_session_question("welcome", vector["welcome"])
        self.assertEqual((index.hex(), again.hex()), (vector["hello_index"], vector["hello_index"]))
        prologue = r.session_prologue(FLEET.public, *instances, index)
        self.assertEqual(prologue.hex(), vector["prologue"])
        secrets = [bytes.fromhex(each) for each in vector["ephemeral_secrets"]]
        initiator = r.Handshake(CAR1, CAR2.public, True, prologue, secrets[0])
        responder = r.Handshake(CAR2, CAR1.public, False, prologue, secrets[1])
        self.assertEqual(initiator.write(b""), first)
        self.assertEqual(responder.read(first), b"")
        self.assertEqual(responder.write(bytes.fromhex(vector["index"])), second)
        self.assertEqual(initiator.read(second).hex(), vector["index"])
        self.assertEqual(initiator.split()[0].hex(), vector["key"])
        self.assertEqual(responder.split()[1].hex(), vector["key"])
        for parties in ((instances[1], instances[0]), (instances[0], instances[0])):
            other = r.Handshake(CAR2, CAR1.public, False, r.session_prologue(FLEET.public, *parties, index), secrets[1])
            with self.assertRaises(r.Refused):
                other.read(first)
        for wrong in (vector["hello"][:-1], vector["hello"] + "A", vector["welcome"], "hello"):
            with self.assertRaises(r.Refused):
                r.read_session_question("hello", wrong)

    def test_messages_of_a_session_are_opened(self):
        vector = VECTORS["pool_session"]
        key, sealed = bytes.fromhex(vector["key"]), bytes.fromhex(vector["sealed"])
        subjects = vector["subject"], vector["reply"]
        self.assertEqual(r.open_session(key, *subjects, sealed), vector["message"].encode())
        self.assertEqual(r.seal_session(key, int(vector["instances"][0], 16), bytes.fromhex(vector["index"]),
                                        vector["counter"], *subjects, vector["message"].encode()), sealed)
        for wrong in (("x", vector["reply"]), (vector["subject"], ""), (vector["subject"], "a\nb")):
            with self.assertRaises(r.Refused, msg=str(wrong)):
                r.open_session(key, *wrong, sealed)
        for place in range(len(sealed)):
            with self.assertRaises(r.Refused):
                r.open_session(key, *subjects, sealed[:place])
            for bit in range(8):
                changed = bytearray(sealed)
                changed[place] ^= 1 << bit
                with self.assertRaises(r.Refused):
                    r.open_session(key, *subjects, bytes(changed))

    def test_a_roster_is_asked_for_and_given(self):
        asked, given = bytes.fromhex(VECTORS["ask"]["message"]), bytes.fromhex(VECTORS["given_roster"]["message"])
        self.assertEqual(r.read_ask(asked), (1, VECTORS["ask"]["version"]))
        self.assertEqual(r.ask(1, 7), asked)
        self.assertEqual(r.take_roster(CAR1, given), VECTORS["roster"].encode())
        self.assertEqual(given[:4], r.head(r.ROSTER, 3))
        for receiver, message in ((CAR2, given), (CAR1, given[:-1]), (CAR1, given[:4]), (CAR1, b"\x86" + given[1:])):
            with self.assertRaises(r.Refused):
                r.take_roster(receiver, message)

    def test_no_bit_of_them_can_be_changed(self):
        group_key = bytes.fromhex(VECTORS["group_keys"]["current"])
        sealed = [(r.open_data, self.keys()[v["from"]], bytes.fromhex(v["datagram"])) for v in VECTORS["data"]]
        sealed.append((r.open_group, group_key, bytes.fromhex(VECTORS["group"]["datagram"])))
        for opened, key, datagram in sealed:
            for place in range(len(datagram)):
                for bit in range(8):
                    changed = bytearray(datagram)
                    changed[place] ^= 1 << bit
                    with self.assertRaises(r.Refused):
                        opened(key, bytes(changed))
            for length in range(len(datagram)):
                with self.assertRaises(r.Refused):
                    opened(key, datagram[:length])

    def test_the_longest_line_fits(self):
        self.assertEqual(len(r.seal_group(bytes(32), 3, 5, bytes(16), 0, bytes(1200))), 1248)
        self.assertEqual(len(r.seal_data(bytes(32), 3, bytes(8), 0, bytes(1200))), 1236)

    def test_a_counter_is_accepted_once(self):
        window = r.ReplayWindow(first=17)
        self.assertFalse(window.accept(16))
        numbers = list(range(17, 17 + 600))
        random.shuffle(numbers)
        self.assertTrue(all(window.accept(number) for number in numbers))
        self.assertFalse(any(window.accept(number) for number in numbers))
        self.assertTrue(window.accept(5000))
        self.assertFalse(window.accept(5000 - 1024))
        self.assertTrue(window.accept(5000 - 1023))


class Signatures(unittest.TestCase):
    def request(self) -> list:
        keys = ("requester", "node", "challenge", "verb", "noun", "body", "waits_ms")
        return [VECTORS["signed_request"][key] for key in keys]

    def test_requests_and_updates(self):
        request, update = VECTORS["signed_request"], VECTORS["signed_update"]
        for vector in (request, VECTORS["signed_request_with_bytes"]):
            signature, waits_ms = r.request_signature(vector["sig"])
            self.assertEqual(waits_ms, vector["waits_ms"])
            message = r.request_to_sign(FLEET.public, *self.request(), vector["bytes"].encode())
            r.verify(CAR1.public, message, signature)
        self.assertEqual(r.request_to_sign(FLEET.public, *self.request()),
                         b"cles request 2\noJEJNdAl7UcDSSx801tdfCDUe3RHajFnIbjhvyFte54\ncar1\ncar2\n"
                         b'RfCf_afVdf9dWuK7AU_gmg\nDELEGATE strike/now\n{"track":3}\n4900\n\n')
        r.verify(CAR2.public, r.update_to_sign(FLEET.public, *(update[key] for key in
                 ("publisher", "noun", "seq", "epoch", "body"))), r.binary(update["sig"], 64))

    def test_announcements(self):
        entry = VECTORS["announced"]
        announced, challenge = entry["announced"], entry["challenge"]
        reply = {**entry, "sig": entry["sig_of_reply"]}
        r.verify_announced(FLEET.public, "car2", CAR2.public, announced, entry)
        r.verify_announced(FLEET.public, "car2", CAR2.public, announced, reply, challenge)
        for changes in (
            {"fleet": CAR1.public}, {"publisher": "car1"}, {"public": CAR1.public}, {"announced": announced + " "},
            {"entry": {**entry, "seq": 19}}, {"entry": {**entry, "epoch": "5f3a09c2"}}, {"entry": reply},
            {"challenge": challenge}, {"entry": reply, "challenge": "A" * 22}, {"challenge": "short"},
        ):
            given = {"fleet": FLEET.public, "publisher": "car2", "public": CAR2.public, "announced": announced,
                     "entry": entry, **changes}
            with self.assertRaises(r.Refused, msg=str(changes)):
                r.verify_announced(**given)
        message = r.update_to_sign(FLEET.public, "car2", "cles", 1, "5f3a09c1", '{"node":"car1"}')
        with self.assertRaises(r.Refused):
            r.verify_announced(FLEET.public, "car2", CAR2.public, '{"node":"car1"}',
                               {"seq": 1, "epoch": "5f3a09c1", "sig": r.text(CAR2.sign(message))})

    def test_each_part_of_a_request_is_signed(self):
        parts, (signature, _) = self.request(), r.request_signature(VECTORS["signed_request"]["sig"])
        others = ("car3", "car3", "A" * 22, "push", "strike", '{"track":4}', 4901, b"hello")
        for place, other in enumerate(others):
            changed = [other if number == place else part for number, part in enumerate([*parts, b""])]
            with self.assertRaises(r.Refused):
                r.verify(CAR1.public, r.request_to_sign(FLEET.public, *changed), signature)
        with self.assertRaises(r.Refused):
            r.verify(CAR1.public, r.request_to_sign(CAR2.public, *parts), signature)

    def test_a_request_states_how_long_its_requester_waits(self):
        signature = VECTORS["signed_request"]["sig"].partition(".")[0]
        for wrong in ("", ".", ".0", ".01", ".-1", ".86400001", ".1.1", ".x", ".1 "):
            with self.assertRaises(r.Refused, msg=wrong):
                r.request_signature(signature + wrong)
        self.assertEqual(r.request_signature(signature + ".86400000")[1], 86_400_000)

    def test_it_runs_only_as_long_as_its_requester_waits(self):
        day = 86_400_000
        for waits, verb, first, since, expected in (
            (4900, "DELEGATE", 5000, 4899, True), (4900, "DELEGATE", 5000, 4900, False),
            (4900, "DELEGATE", 1000, 1000, False), (day, "DELEGATE", day, 29_999, True),
            (day, "DELEGATE", day, 30_000, False), (day, "PULL", day, 4999, True), (day, "pull", day, 5000, False),
        ):
            self.assertEqual(r.may_run(waits, verb, first, since), expected, (waits, verb, first, since))

    def test_what_a_node_demands_is_checked_before_it_is_signed(self):
        for place, wrong in ((1, ""), (1, "car 2"), (1, "car2\nx"), (2, ""), (2, "A" * 21), (2, "A" * 21 + "B"),
                             (2, "A" * 22 + "\n"), (4, "strike\nx")):
            parts = self.request()
            parts[place] = wrong
            with self.assertRaises(r.Refused, msg=repr(wrong)):
                r.request_to_sign(FLEET.public, *parts)

    def test_one_kind_of_signature_is_not_another(self):
        update = VECTORS["signed_update"]
        message = r.update_to_sign(FLEET.public, "car2", "localization", 17, "5f3a09c1", '{"utc":2}')
        for start in (b"cles request 2\n", b"cles roster 1\n"):
            with self.assertRaises(r.Refused):
                r.verify(CAR2.public, start + message.split(b"\n", 1)[1], r.binary(update["sig"], 64))


if __name__ == "__main__":
    unittest.main(verbosity=2)
