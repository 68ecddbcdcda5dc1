#!/usr/bin/env python3
# SPDX-License-Identifier: BSL-1.0
"""Datagrams and messages that the library seals are opened by the reference implementation, and the other way round.

    datagram_interoperation_test.py PROGRAM [unittest options]       PROGRAM is cles_security_datagrams
"""

import os
import subprocess
import sys
import unittest

from reference_or_skip import r, sodium

PROGRAM = ""
VERSION, GENERATION = 41, 7
EPOCH = "5f3a09c1"  # of the library's node, which is car1 and has the number 5
CAR1, CAR2 = 5, 2**24 - 1


class Library(unittest.TestCase):
    """car1 is a node of the library, car2 the reference implementation."""

    def setUp(self):
        self.fleet, self.other_fleet, self.car2, self.stranger = (r.Identity(os.urandom(32)) for _ in range(4))
        seed = os.urandom(32)
        self.car1 = r.Identity(seed)
        self.group_keys = os.urandom(32), os.urandom(32)
        self.salt = os.urandom(16)
        self.program = subprocess.Popen([PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.addCleanup(self.program.stdout.close)
        self.addCleanup(self.program.wait)
        self.addCleanup(self.program.stdin.close)
        line = self.roster(VERSION).decode()
        self.assertEqual(self.command(f"node car1 {seed.hex()} {self.fleet.public.hex()} {EPOCH} {line}"), [])

    def roster(self, version: int) -> bytes:
        return r.sign_roster(self.fleet, {
            "fleet": r.text(self.fleet.public), "version": version, "last": CAR2, "generation": GENERATION,
            "oldest": GENERATION, "keys": self.sealed(self.fleet), "members": [
                {"number": number, "name": name, "key": r.text(who.public), "keys": self.sealed(who)}
                for number, name, who in ((CAR1, "car1", self.car1), (CAR2, "car2", self.car2))]})

    def sealed(self, receiver: r.Identity) -> str:
        return r.text(sodium.crypto_box_seal(b"".join(self.group_keys), receiver.dh_public))

    def command(self, text: str) -> list:
        self.program.stdin.write(text + "\n")
        self.program.stdin.flush()
        done = []
        for line in self.program.stdout:
            if line == ".\n":
                return done
            done.append(line[:-1])
        self.fail(f"the program ended at: {text}")

    def receive(self, datagram: bytes) -> list:
        return self.command("receive " + datagram.hex())

    def datagram(self, line: str) -> bytes:
        self.assertTrue(line.startswith("datagram "), line)
        return bytes.fromhex(line.removeprefix("datagram "))

    def check_statement(self, payload: bytes) -> None:
        self.assertEqual(int.from_bytes(payload[8:12], "big"), VERSION)
        self.assertEqual(payload[12:16].hex(), EPOCH)

    def hello(self, me=None, fleet=None, number=CAR1, member=CAR2, epoch="0a0b0c0d", counter=40, marked=False) -> bytes:
        """car2's HELLO, or one that is wrong somewhere. Its handshake is in `self.handshake`."""
        self.index = os.urandom(8)
        start = r.head(r.HELLO, member) + self.index
        self.handshake = r.Handshake(me or self.car2, self.car1.public, True,
                                     r.prologue((fleet or self.fleet).public, number, start), os.urandom(32))
        hello = start + self.handshake.write(r.hello_payload(VERSION - 1, epoch, self.salt, counter))
        return hello + r.hello_mac(me or self.car2, self.car1.public, (fleet or self.fleet).public, member, number,
                                   hello) if marked else hello

    def welcome(self, hello: bytes, epoch="0a0b0c0d") -> bytes:
        """car2's answer to a HELLO of the library."""
        hello = r.read_hello(self.car2, CAR2, self.car1.public, self.fleet.public, hello)
        self.assertEqual(hello[:4], r.head(r.HELLO, CAR1))
        handshake = r.Handshake(self.car2, self.car1.public, False, r.prologue(self.fleet.public, CAR2, hello[:12]),
                                os.urandom(32))
        payload = handshake.read(hello[12:])
        self.check_statement(payload)
        self.assertEqual(payload[:8], bytes(8))
        self.index, self.peer_index, self.handshake = os.urandom(8), hello[4:12], handshake
        return r.head(r.WELCOME, CAR2) + hello[4:12] + handshake.write(
            r.welcome_payload(self.index, VERSION, epoch, self.salt, 40))

    def connect(self, marked=False) -> None:
        """A session that car2 began."""
        welcome = self.datagram(self.receive(self.hello(marked=marked))[0])
        self.assertEqual((len(welcome), welcome[:12]), (100, r.head(r.WELCOME, CAR1) + self.index))
        payload = self.handshake.read(welcome[12:])
        self.check_statement(payload)
        self.peer_index, self.stated_salt = payload[:8], payload[16:32]
        self.stated_counter = int.from_bytes(payload[32:], "big")
        self.sending, self.receiving = self.handshake.split()

    def data(self, counter: int, line: bytes) -> bytes:
        return r.seal_data(self.sending, CAR2, self.peer_index, counter, line)

    def open(self, datagram: bytes) -> tuple:
        """The counter and the line of DATA from the library."""
        self.assertEqual(datagram[:12], r.head(r.DATA, CAR1) + self.index)
        return int.from_bytes(datagram[12:20], "big"), r.open_data(self.receiving, datagram)

    def test_a_session_that_begins_with_a_mac(self):
        self.connect(marked=True)
        self.assertEqual(self.receive(self.data(0, b"PULL car1:speed id=1"))[1:],
                         [f"opened {CAR2} 0a0b0c0d PULL car1:speed id=1"])

    def test_a_session_that_the_reference_begins(self):
        self.connect()
        self.assertEqual(self.receive(self.data(0, b"PULL car1:speed id=1")),
                         [f"established {CAR2} {VERSION - 1} 0a0b0c0d {self.salt.hex()} 40 -",
                          f"opened {CAR2} 0a0b0c0d PULL car1:speed id=1"])
        sent = self.command(f'send {CAR2} id=1 {{"v":27.5}}')
        self.assertEqual([self.open(self.datagram(line)) for line in sent], [(0, b'id=1 {"v":27.5}')])
        self.assertEqual(self.receive(self.data(0, b"PULL car1:speed id=1")), [])
        self.assertEqual(self.receive(self.data(5, b"x" * 1200)), [f"opened {CAR2} 0a0b0c0d " + "x" * 1200])
        self.assertEqual(self.receive(self.data(3, b"late")), [f"opened {CAR2} 0a0b0c0d late"])

    def test_an_empty_line_is_answered(self):
        self.connect()
        established, *rest = sorted(self.receive(self.data(0, b"")), reverse=True)
        self.assertTrue(established.startswith("established"))
        self.assertEqual([self.open(self.datagram(line)) for line in rest], [(0, b"")])

    def test_a_session_that_the_library_begins(self):
        hello, = self.command(f"send {CAR2} PULL car2:speed id=1")
        self.assertEqual(len(self.datagram(hello)), 116)
        self.assertEqual(self.command("wait 200"), [hello, hello[:-32]])
        sent, established = self.receive(self.welcome(self.datagram(hello)))
        self.assertEqual(established, f"established {CAR2} {VERSION} 0a0b0c0d {self.salt.hex()} 40 -")
        self.sending, self.receiving = self.handshake.split()
        self.assertEqual(self.open(self.datagram(sent)), (0, b"PULL car2:speed id=1"))
        empty, = self.command("wait 200")
        self.assertEqual(self.open(self.datagram(empty)), (1, b""))
        self.assertEqual(self.receive(self.data(0, b"id=1 {}")), [f"opened {CAR2} 0a0b0c0d id=1 {{}}"])
        self.assertEqual(self.receive(self.data(1, b"")), [])
        self.assertEqual(self.command("wait 5000"), [])

    def test_a_restart(self):
        self.connect()
        self.receive(self.data(0, b"one"))
        self.receive(self.hello(epoch="0a0b0c0e"))
        welcome, = self.receive(self.hello(epoch="0a0b0c0e"))
        payload = self.handshake.read(self.datagram(welcome)[12:])
        self.peer_index, (self.sending, self.receiving) = payload[:8], self.handshake.split()
        self.assertEqual(self.receive(self.data(0, b"two")),
                         [f"established {CAR2} {VERSION - 1} 0a0b0c0e {self.salt.hex()} 40 restarted",
                          f"opened {CAR2} 0a0b0c0e two"])

    def test_hellos_that_are_not_answered(self):
        for wrong in ({"me": self.stranger}, {"fleet": self.other_fleet}, {"number": CAR2}, {"member": CAR1}, {"member": 6},
                      {"me": self.car1}):
            for marked in (False, True):
                self.assertEqual(self.receive(self.hello(**wrong, marked=marked)), [], str(wrong))

    def test_no_bit_of_a_mac_can_be_changed(self):
        hello = self.hello(marked=True)
        for place in range(100, 116):
            for bit in range(8):
                changed = bytearray(hello)
                changed[place] ^= 1 << bit
                self.assertEqual(self.receive(bytes(changed)), [])
        self.assertEqual(len(self.receive(hello)), 1)

    def test_no_bit_of_data_can_be_changed(self):
        self.connect()
        self.receive(self.data(0, b"first"))
        datagram = self.data(1, b"PUSH car1:target id=1")
        for place in range(len(datagram)):
            for bit in range(8):
                changed = bytearray(datagram)
                changed[place] ^= 1 << bit
                self.assertEqual(self.receive(bytes(changed)), [])
        self.assertEqual(len(self.receive(datagram)), 1)

    def test_group(self):
        key = self.group_keys[0]
        self.connect()
        received = self.command("open " + r.seal_group(key, CAR2, GENERATION, self.salt, 40, b"early").hex())
        self.assertEqual(received, [f"unknown {CAR2}"])
        self.receive(self.data(0, b""))
        sealed = [r.seal_group(key, CAR2, GENERATION, self.salt, counter, b"UPDATE car2:speed") for counter in (39, 40, 45)]
        self.assertEqual([self.command("open " + datagram.hex()) for datagram in sealed], [
            [f"refused {CAR2} 0a0b0c0d UPDATE car2:speed"], [f"accepted {CAR2} 0a0b0c0d UPDATE car2:speed"],
            [f"accepted {CAR2} 0a0b0c0d UPDATE car2:speed"]])
        following = r.seal_group(self.group_keys[1], CAR2, GENERATION + 1, self.salt, 46, b"with the next key")
        self.assertEqual(self.command("open " + following.hex()), [f"accepted {CAR2} 0a0b0c0d with the next key"])

        window = r.ReplayWindow(self.stated_counter)
        for number in range(3):
            text, = self.command(f"seal UPDATE car1:speed {number}")
            datagram = bytes.fromhex(text.removeprefix("sealed "))
            self.assertEqual(datagram[:8], r.head(r.GROUP, CAR1) + GENERATION.to_bytes(4, "big"))
            self.assertEqual(datagram[8:24], self.stated_salt)
            self.assertEqual(r.open_group(key, datagram), f"UPDATE car1:speed {number}".encode())
            self.assertTrue(window.accept(int.from_bytes(datagram[24:32], "big")))

    def message(self, text: bytes, counter: int, subject="cles.x", reply="", following=0) -> bytes:
        """A message of car2."""
        return r.seal_pool(self.group_keys[following], self.fleet.public, self.car2, CAR2, GENERATION + following, self.salt,
                           counter, subject, reply, text)

    def open_message(self, message: bytes, subject="cles.x", reply="-") -> list:
        return self.command(f"open_message {subject} {reply} {r.instance(CAR2, self.salt)} car2.seal {message.hex()}")

    def open_for(self, message: bytes) -> list:
        """As a message for one bridge."""
        return self.command(f"open_for cles.x - {r.instance(CAR2, self.salt)} car2.seal {message.hex()}")

    def question(self, message: bytes) -> list:
        return self.command(f"question questions {r.instance(CAR2, self.salt)} car2.seal {message.hex()}")

    def opened(self, line: str, subject: str, reply: str) -> bytes:
        """A message of the library."""
        message = bytes.fromhex(line.split()[-1])
        self.assertEqual(message[:8], r.head(r.POOL, CAR1) + GENERATION.to_bytes(4, "big"))
        instance, = self.command("instance")
        self.assertEqual(instance, f"instance {r.instance(CAR1, message[8:24])}")
        return r.open_pool(self.group_keys[0], self.fleet.public, self.car1.public, subject, reply, message)

    def test_messages_through_nats(self):
        window = r.ReplayWindow()
        for number in range(3):
            sealed, = self.command(f"seal_message cles.a cles.b PULL car2:speed {number}")
            self.assertEqual(self.opened(sealed, "cles.a", "cles.b"), f"PULL car2:speed {number}".encode())
            self.assertTrue(window.accept(int.from_bytes(bytes.fromhex(sealed.split()[1])[24:32], "big")))
        unproven, asked = self.open_message(self.message(b"request", 40))
        self.assertEqual(unproven, "unproven car2 request")
        self.assertTrue(asked.startswith("question car2.seal "))
        word, challenge = self.opened(asked, "car2.seal", "questions").split()
        self.assertEqual((word, len(r.binary(challenge.decode(), 16))), (b"ask", 16))

        live = self.message(b"live " + challenge, 41, "questions", "car2.seal")
        self.assertEqual(self.question(live), ["heartbeat"])
        results = [self.open_message(self.message(b"request", counter))[0] for counter in (40, 41, 42, 42, 2000, 976, 977)]
        self.assertEqual(results, [f"{what} car2 request" if what == "opened" else "refused  "
                                   for what in ("refused", "refused", "opened", "refused", "opened", "refused", "opened")])
        self.assertEqual(self.open_message(self.message(b"next", 2001, following=1)), ["opened car2 next"])

        heartbeat, answer = self.question(self.message(b"ask " + challenge, 2002, "questions", "car2.seal"))
        self.assertEqual(heartbeat, "heartbeat")
        self.assertEqual(self.opened(answer, "car2.seal", "questions"), b"live " + challenge)

    def test_a_session_of_two_bridges(self):
        car2 = r.instance(CAR2, self.salt)
        car1 = int(self.command("instance")[0].split()[1])
        _, asked = self.open_message(self.message(b"request", 40))
        challenge = self.opened(asked, "car2.seal", "questions").split()[1]
        self.question(self.message(b"live " + challenge, 41, "questions", "car2.seal"))

        hello, = self.command(f"able {car2} car2.seal")
        index, first = r.read_session_question("hello", self.opened(hello, "car2.seal", "questions").decode())
        self.assertEqual(self.command(f"seal_for {car2} cles.a cles.b early"), ["waits"])
        handshake = r.Handshake(self.car2, self.car1.public, False, r.session_prologue(self.fleet.public, car1, car2, index),
                                os.urandom(32))
        self.assertEqual(handshake.read(first), b"")
        of_session = os.urandom(8)
        welcome = r.session_question("welcome", index, handshake.write(of_session)).encode()
        self.assertEqual(self.question(self.message(welcome, 42, "questions", "car2.seal")), [])
        for counter in range(2):
            sealed, = self.command(f"seal_for {car2} cles.a cles.b PULL car2:speed {counter}")
            message = bytes.fromhex(sealed.removeprefix("sealed "))
            self.assertEqual(message[1:25], car1.to_bytes(8, "big") + of_session + counter.to_bytes(8, "big"))
            self.assertEqual(r.open_session(handshake.split()[1], "cles.a", "cles.b", message),
                             f"PULL car2:speed {counter}".encode())

        index = os.urandom(8)
        handshake = r.Handshake(self.car2, self.car1.public, True, r.session_prologue(self.fleet.public, car2, car1, index),
                                os.urandom(32))
        hello = r.session_question("hello", index, handshake.write(b"")).encode()
        answer, = self.question(self.message(hello, 43, "questions", "car2.seal"))
        back, second = r.read_session_question("welcome", self.opened(answer, "car2.seal", "questions").decode())
        self.assertEqual(back, index)
        of_session = handshake.read(second)
        key = handshake.split()[0]
        sealed = [r.seal_session(key, car2, of_session, counter, "cles.x", "", b"request") for counter in (0, 1, 0, 2000, 976)]
        self.assertEqual([self.open_for(each) for each in sealed],
                         [["opened car2 request"], ["opened car2 request"], ["refused  "], ["opened car2 request"], ["refused  "]])
        for place in range(1, len(sealed[0])):
            changed = bytearray(r.seal_session(key, car2, of_session, 2001, "cles.x", "", b"request"))
            changed[place] ^= 1 << place % 8
            self.assertEqual(self.open_for(bytes(changed))[0], "refused  ")
        # What is signed counts for all bridges only.
        self.assertEqual(self.open_for(self.message(b"request", 44)), ["refused  "])
        self.assertEqual(self.open_message(self.message(b"heartbeat", 45)), ["opened car2 heartbeat"])
        self.command("wait 1000")
        refused, told = self.open_for(r.seal_session(key, car2, bytes(8), 0, "cles.x", "", b"request"))
        self.assertEqual(refused, "refused  ")
        self.assertEqual(self.opened(told, "car2.seal", "questions"), b"unknown " + b"0" * 16)

    def test_no_bit_of_a_message_can_be_changed(self):
        message = self.message(b"request", 40)
        for place in range(len(message)):
            changed = bytearray(message)
            changed[place] ^= 1 << place % 8
            self.assertEqual(self.open_message(bytes(changed))[0], "refused  ")
        self.assertEqual(self.open_message(message, subject="cles.y"), ["refused  "])
        self.assertEqual(self.open_message(message, reply="cles.y"), ["refused  "])
        self.assertEqual(self.open_message(message)[0], "unproven car2 request")

    def test_a_roster_is_asked_for_and_given(self):
        given, = self.question(r.ask(CAR2, VERSION - 1))
        self.assertTrue(given.startswith("question car2.seal "))
        message = bytes.fromhex(given.split()[-1])
        self.assertEqual(message[:4], r.head(r.ROSTER, CAR1))
        self.assertEqual(r.read_roster(r.take_roster(self.car2, message), self.fleet.public)["version"], VERSION)
        self.command("wait 1000")
        self.assertEqual(self.question(r.ask(CAR2, VERSION)), [])

        newer = self.roster(VERSION + 1)
        answer = r.give_roster(CAR2, self.car1.public, newer)
        self.assertEqual(self.question(answer), [])
        asked, = self.command(f"stated {r.instance(CAR2, self.salt)} car2.seal {VERSION + 1}")
        self.assertEqual(r.read_ask(bytes.fromhex(asked.removeprefix("question car2.seal "))), (CAR1, VERSION))
        self.assertEqual(self.question(answer), [f"roster {newer.decode()}"])


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main(verbosity=2)
