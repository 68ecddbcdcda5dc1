# SPDX-License-Identifier: BSL-1.0
"""The formats of docs/protocol_security.md, written from that page alone, with PyNaCl for the primitives."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import re

from nacl import bindings as sodium


class Refused(Exception):
    """What the page says is not accepted."""


# --- Keys and texts ------------------------------------------------------------------------------------------------------


def text(binary: bytes) -> str:
    return base64.urlsafe_b64encode(binary).rstrip(b"=").decode()


def binary(encoded: str, length: int) -> bytes:
    """The bytes of base64url without padding. Every value has one spelling: other characters and stray bits are refused."""
    if not isinstance(encoded, str) or not re.fullmatch(r"[A-Za-z0-9_-]*", encoded):
        raise Refused("not base64url")
    try:
        value = base64.urlsafe_b64decode(encoded + "=" * (-len(encoded) % 4))
    except ValueError as error:
        raise Refused("not base64url") from error
    if len(value) != length or text(value) != encoded:
        raise Refused(f"not {length} bytes")
    return value


class Identity:
    """An Ed25519 key pair, made from its 32-byte seed, and its X25519 form."""

    def __init__(self, seed: bytes):
        self.public, self.secret = sodium.crypto_sign_seed_keypair(seed)
        self.dh_public = x25519_of(self.public)
        self.dh_secret = sodium.crypto_sign_ed25519_sk_to_curve25519(self.secret)

    def sign(self, message: bytes) -> bytes:
        return sodium.crypto_sign(message, self.secret)[:64]


def x25519_of(public: bytes) -> bytes:
    """A key that is no point of prime order has no X25519 form."""
    if not sodium.crypto_core_ed25519_is_valid_point(public):
        raise Refused("a key that is not valid")
    return sodium.crypto_sign_ed25519_pk_to_curve25519(public)


def fingerprint(name: str, public: bytes) -> str:
    digits = hashlib.sha256(f"cles fingerprint 1\n{name}\n".encode() + public).hexdigest()
    return "-".join(digits[at:at + 4] for at in range(0, 20, 4))


def verify(public: bytes, message: bytes, signature: bytes) -> None:
    try:
        sodium.crypto_sign_open(signature + message, public)
    except Exception as error:
        raise Refused("wrong signature") from error


# --- The roster ----------------------------------------------------------------------------------------------------------

ROSTER_LINE = re.compile(rb'\{"signature":"([A-Za-z0-9_-]{86})","roster":(\{.*\})\}')
NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")
ROSTER_KEYS = {"fleet", "version", "last", "generation", "oldest", "keys", "members"}
MEMBER_KEYS = {"number", "name", "key", "keys", "may", "offers", "forwards"}
SEALED_KEYS = 32 + 32 + 48
ROSTER_LIMIT = 1_000_000
MAX_DEPTH = 32


def sign_roster(fleet: Identity, roster: dict) -> bytes:
    content = json.dumps(roster, separators=(",", ":")).encode()
    signature = fleet.sign(b"cles roster 1\n" + content)
    return b'{"signature":"' + text(signature).encode() + b'","roster":' + content + b"}"


def whole(value, low: int, high: int) -> int:
    if type(value) is not int or not low <= value <= high:
        raise Refused(f"not a whole number from {low} to {high}")
    return value


def read_roster(line: bytes, fleet: bytes) -> dict:
    if len(line) > ROSTER_LIMIT:
        raise Refused("too long")
    match = ROSTER_LINE.fullmatch(line)
    if not match:
        raise Refused("not of the form of a roster")
    verify(fleet, b"cles roster 1\n" + match.group(2), binary(match.group(1).decode(), 64))
    roster = strict_json(match.group(2))
    if binary(roster.get("fleet"), 32) != fleet:
        raise Refused("of another fleet")
    for known, entry in [(ROSTER_KEYS, roster)] + [(MEMBER_KEYS, m) for m in members_of(roster)]:
        if any(key.startswith("must_") for key in set(entry) - known):
            raise Refused("has a key that must be understood")
    whole(roster.get("version"), 1, 2**32 - 1)
    last = whole(roster.get("last"), 0, 2**24 - 1)
    generation = whole(roster.get("generation"), 1, 2**32 - 2)
    whole(roster.get("oldest"), max(1, generation - 1), generation)
    binary(roster.get("keys"), SEALED_KEYS)
    number = 0
    for member in members_of(roster):
        number = whole(member.get("number"), number + 1, last)
        if not isinstance(member.get("name"), str) or not NAME.fullmatch(member["name"]):
            raise Refused("has a member without a valid name")
        if member["name"] in ("self", "any", "all"):
            raise Refused("has a member with a reserved name")
        x25519_of(binary(member.get("key"), 32))
        binary(member.get("keys"), SEALED_KEYS)
        for patterns in ("may", "offers", "forwards"):
            listed = member.get(patterns, [])
            if not isinstance(listed, list) or not all(isinstance(pattern, str) for pattern in listed):
                raise Refused(f"has '{patterns}' that are not texts")
    for unique in ("name", "key"):
        values = [member[unique] for member in members_of(roster)]
        if len(set(values)) != len(values):
            raise Refused(f"has two members with one {unique}")
    return roster


def strict_json(text: bytes) -> dict:
    def refuse(constant: str):
        raise ValueError(constant)

    try:
        # -0 is a float, so that it is no whole number.
        value = json.loads(text.decode(), object_pairs_hook=without_repeats, parse_constant=refuse,
                           parse_int=lambda digits: -0.0 if digits == "-0" else int(digits))
        json.dumps(value, ensure_ascii=False).encode()  # no half of a surrogate pair
    except (ValueError, RecursionError) as error:
        raise Refused("not JSON") from error
    if depth(value) > MAX_DEPTH:
        raise Refused("nested too deep")
    return value


def depth(value) -> int:
    if not isinstance(value, (dict, list)):
        return 0
    return 1 + max(map(depth, value.values() if isinstance(value, dict) else value), default=0)


def without_repeats(pairs: list) -> dict:
    if len({key for key, _ in pairs}) != len(pairs):
        raise Refused("has a key twice")
    return dict(pairs)


def members_of(roster: dict) -> list:
    members = roster.get("members")
    if not isinstance(members, list) or len(members) > 4096 or not all(isinstance(m, dict) for m in members):
        raise Refused("has no valid list of members")
    return members


def group_keys(sealed: str, receiver: Identity) -> tuple[bytes, bytes]:
    """The current key and the next one."""
    try:
        opened = sodium.crypto_box_seal_open(binary(sealed, SEALED_KEYS), receiver.dh_public, receiver.dh_secret)
    except Exception as error:
        raise Refused("sealed for somebody else") from error
    return opened[:32], opened[32:]


# --- Signed requests and updates -----------------------------------------------------------------------------------------

CHALLENGE = 16


LONGEST_WAIT = 86_400_000


def to_sign(kind: str, fleet: bytes, *lines: str) -> bytes:
    """`kind` includes the version. No line contains a line end, so that a text has one reading."""
    if any("\n" in line for line in lines):
        raise Refused("a line end")
    return "".join(line + "\n" for line in (f"cles {kind}", text(fleet), *lines)).encode()


def request_to_sign(fleet: bytes, requester: str, node: str, challenge: str, verb: str, noun: str, body: str,
                    waits_ms: int, following: bytes = b"") -> bytes:
    """`waits_ms` is how long the requester goes on waiting, `following` what follows the line."""
    if not NAME.fullmatch(node):
        raise Refused("not a name")
    binary(challenge, CHALLENGE)
    digest = hashlib.sha256(following).hexdigest() if following else ""
    return to_sign("request 2", fleet, requester, node, challenge, f"{verb.upper()} {noun}", body or "{}",
                   str(waits_ms), digest)


def request_signature(sig: str) -> tuple[bytes, int]:
    """The signature in `sig=` of a request, and how long the requester goes on waiting."""
    signature, dot, waits = sig.partition(".")
    if not re.fullmatch("[1-9][0-9]{0,7}", waits) or int(waits) > LONGEST_WAIT:
        raise Refused("not <signature>.<ms>")
    return binary(signature, 64), int(waits)


def may_run(waits_ms: int, verb: str, first_deadline_ms: int, since_challenge_ms: int) -> bool:
    """Whether the executing node still accepts the signed request, that long after it has issued the challenge."""
    default = 30_000 if verb.upper() == "DELEGATE" else 5_000
    return since_challenge_ms < min(waits_ms, first_deadline_ms, default)


def update_to_sign(fleet: bytes, publisher: str, noun: str, seq: int, epoch: str, body: str) -> bytes:
    return to_sign("update 1", fleet, publisher, noun, f"{seq} {epoch}", body)


def verify_announced(fleet: bytes, publisher: str, public: bytes, announced: str, entry: dict, challenge: str = "") -> None:
    """An entry of gossip, or with a challenge the reply to PULL of cles/announced; `announced` is its text as written."""
    noun = "cles"
    if challenge:
        binary(challenge, CHALLENGE)
        noun = f"cles/announced/{challenge}"
    message = update_to_sign(fleet, publisher, noun, entry["seq"], entry["epoch"], announced)
    verify(public, message, binary(entry["sig"], 64))
    if json.loads(announced).get("node") != publisher:
        raise Refused("an announcement of another node")


# --- Noise_KK_25519_ChaChaPoly_SHA256 ------------------------------------------------------------------------------------

PROTOCOL = b"Noise_KK_25519_ChaChaPoly_SHA256"  # 32 bytes, so the first hash is the name itself


def noise_nonce(counter: int) -> bytes:
    return bytes(4) + counter.to_bytes(8, "little")


def encrypt(key: bytes, counter: int, additional: bytes, plain: bytes) -> bytes:
    return sodium.crypto_aead_chacha20poly1305_ietf_encrypt(plain, additional, noise_nonce(counter), key)


def decrypt(key: bytes, counter: int, additional: bytes, sealed: bytes) -> bytes:
    try:
        return sodium.crypto_aead_chacha20poly1305_ietf_decrypt(sealed, additional, noise_nonce(counter), key)
    except Exception as error:
        raise Refused("not authentic") from error


def dh(secret: bytes, public: bytes) -> bytes:
    try:
        return sodium.crypto_scalarmult(secret, public)
    except Exception as error:
        raise Refused("a key of low order") from error


class Handshake:
    """One end of a handshake: a sequence of mixes, as in section 5 of the Noise specification."""

    def __init__(self, me: Identity, peer: bytes, initiator: bool, prologue: bytes, ephemeral: bytes):
        self.me, self.peer, self.initiator = me, x25519_of(peer), initiator
        self.ephemeral = ephemeral
        self.ephemeral_public = sodium.crypto_scalarmult_base(ephemeral)
        self.chaining_key = self.hash = PROTOCOL
        self.key, self.counter = b"", 0
        statics = [me.dh_public, self.peer] if initiator else [self.peer, me.dh_public]
        for part in [prologue, *statics]:
            self.mix_hash(part)

    def mix_hash(self, data: bytes) -> None:
        self.hash = hashlib.sha256(self.hash + data).digest()

    def hkdf(self, material: bytes) -> tuple[bytes, bytes]:
        extracted = hmac.digest(self.chaining_key, material, "sha256")
        first = hmac.digest(extracted, b"\x01", "sha256")
        return first, hmac.digest(extracted, first + b"\x02", "sha256")

    def mix_key(self, material: bytes) -> None:
        self.chaining_key, self.key = self.hkdf(material)
        self.counter = 0

    def write(self, payload: bytes) -> bytes:
        self.mix_hash(self.ephemeral_public)
        self.mix_ephemeral()
        sealed = encrypt(self.key, self.counter, self.hash, payload)
        self.counter += 1
        self.mix_hash(sealed)
        return self.ephemeral_public + sealed

    def read(self, message: bytes) -> bytes:
        self.peer_ephemeral = message[:32]
        self.mix_hash(self.peer_ephemeral)
        self.mix_ephemeral()
        payload = decrypt(self.key, self.counter, self.hash, message[32:])
        self.counter += 1
        self.mix_hash(message[32:])
        return payload

    def mix_ephemeral(self) -> None:
        """The first message mixes es and ss, the second ee and se."""
        if not hasattr(self, "first_done"):
            self.first_done = True
            es = dh(self.ephemeral, self.peer) if self.initiator else dh(self.me.dh_secret, self.peer_ephemeral)
            self.mix_key(es)
            self.mix_key(dh(self.me.dh_secret, self.peer))
        else:
            self.mix_key(dh(self.ephemeral, self.peer_ephemeral))
            self.mix_key(dh(self.me.dh_secret, self.peer_ephemeral) if self.initiator else dh(self.ephemeral, self.peer))

    def split(self) -> tuple[bytes, bytes]:
        """The keys for sending and for receiving."""
        first, second = self.hkdf(b"")
        return (first, second) if self.initiator else (second, first)


# --- Datagrams -----------------------------------------------------------------------------------------------------------

HELLO, WELCOME, DATA, GROUP = 0x81, 0x82, 0x83, 0x84


def head(kind: int, member: int) -> bytes:
    return bytes([kind]) + member.to_bytes(3, "big")


def prologue(fleet: bytes, responder: int, hello_head: bytes) -> bytes:
    return b"cles datagram 1\n" + fleet + responder.to_bytes(3, "big") + hello_head


HELLO_BYTES, MAC_BYTES = 100, 16


def hello_mac(me: Identity, peer: bytes, fleet: bytes, sender: int, responder: int, hello: bytes) -> bytes:
    """Of the first 100 bytes of HELLO. `me` is either of both ends, and `peer` the other one's key."""
    agreed = dh(me.dh_secret, x25519_of(peer))
    numbers = sender.to_bytes(3, "big") + responder.to_bytes(3, "big")
    key = hmac.digest(agreed, b"cles hello 1\n" + fleet + numbers, "sha256")
    return hmac.digest(key, hello, "sha256")[:MAC_BYTES]


def read_hello(me: Identity, number: int, peer: bytes, fleet: bytes, datagram: bytes) -> bytes:
    """The 100 bytes that are opened. A MAC may be missing, but not be wrong."""
    hello, mac = datagram[:HELLO_BYTES], datagram[HELLO_BYTES:]
    if len(hello) != HELLO_BYTES or hello[0] != HELLO or len(mac) not in (0, MAC_BYTES):
        raise Refused("not HELLO")
    expected = hello_mac(me, peer, fleet, int.from_bytes(hello[1:4], "big"), number, hello)
    if mac and not hmac.compare_digest(mac, expected):
        raise Refused("a wrong MAC")
    return hello


def hello_payload(version: int, epoch: str, salt: bytes, counter: int) -> bytes:
    return welcome_payload(bytes(8), version, epoch, salt, counter)


def welcome_payload(index: bytes, version: int, epoch: str, salt: bytes, counter: int) -> bytes:
    return index + version.to_bytes(4, "big") + bytes.fromhex(epoch) + salt + counter.to_bytes(8, "big")


def seal_data(key: bytes, member: int, index: bytes, counter: int, line: bytes) -> bytes:
    start = head(DATA, member) + index + counter.to_bytes(8, "big")
    return start + encrypt(key, counter, start, line)


def open_data(key: bytes, datagram: bytes) -> bytes:
    if len(datagram) < 36 or datagram[0] != DATA:
        raise Refused("not DATA")
    return decrypt(key, int.from_bytes(datagram[12:20], "big"), datagram[:20], datagram[20:])


def seal_group(key: bytes, member: int, generation: int, salt: bytes, counter: int, line: bytes) -> bytes:
    nonce = salt + counter.to_bytes(8, "big")
    start = head(GROUP, member) + generation.to_bytes(4, "big") + nonce
    return start + sodium.crypto_aead_xchacha20poly1305_ietf_encrypt(line, start, nonce, key)


def open_group(key: bytes, datagram: bytes) -> bytes:
    if len(datagram) < 48 or datagram[0] != GROUP:
        raise Refused("not GROUP")
    try:
        return sodium.crypto_aead_xchacha20poly1305_ietf_decrypt(datagram[32:], datagram[:32], datagram[8:32], key)
    except Exception as error:
        raise Refused("not authentic") from error


# --- Messages through NATS -----------------------------------------------------------------------------------------------

POOL, ASK, ROSTER, SESSION = 0x85, 0x86, 0x87, 0x88


def instance(member: int, salt: bytes) -> int:
    return int.from_bytes(member.to_bytes(3, "big") + salt[:5], "big")


def pool_texts(fleet: bytes, start: bytes, subject: str, reply: str, message: bytes) -> tuple[bytes, bytes]:
    """The additional data, and what is signed."""
    if "\n" in subject + reply:
        raise Refused("a line end")
    additional = start + f"{subject}\n{reply}".encode()
    return additional, b"cles pool 1\n" + fleet + additional + b"\n" + message


def seal_pool(key: bytes, fleet: bytes, me: Identity, member: int, generation: int, salt: bytes, counter: int, subject: str,
              reply: str, message: bytes) -> bytes:
    nonce = salt + counter.to_bytes(8, "big")
    start = head(POOL, member) + generation.to_bytes(4, "big") + nonce
    additional, signed = pool_texts(fleet, start, subject, reply, message)
    plain = me.sign(signed) + message
    return start + sodium.crypto_aead_xchacha20poly1305_ietf_encrypt(plain, additional, nonce, key)


def open_pool(key: bytes, fleet: bytes, sender: bytes, subject: str, reply: str, sealed: bytes) -> bytes:
    if len(sealed) < 112 or sealed[0] != POOL:
        raise Refused("not POOL")
    additional, _ = pool_texts(fleet, sealed[:32], subject, reply, b"")
    try:
        plain = sodium.crypto_aead_xchacha20poly1305_ietf_decrypt(sealed[32:], additional, sealed[8:32], key)
    except Exception as error:
        raise Refused("not authentic") from error
    verify(sender, pool_texts(fleet, sealed[:32], subject, reply, plain[64:])[1], plain[:64])
    return plain[64:]


def session_prologue(fleet: bytes, initiator: int, responder: int, index: bytes) -> bytes:
    return b"cles pool session 1\n" + fleet + initiator.to_bytes(8, "big") + responder.to_bytes(8, "big") + index


def session_question(word: str, index: bytes, handshake: bytes) -> str:
    """`hello` and `welcome`: the index is that of HELLO."""
    return f"{word} {text(index + handshake)}"


def read_session_question(word: str, question: str) -> tuple[bytes, bytes]:
    """The index of HELLO, and the message of the handshake."""
    head, _, value = question.partition(" ")
    if head != word:
        raise Refused(f"not {word}")
    whole_value = binary(value, {"hello": 8 + 48, "welcome": 8 + 56}[word])
    return whole_value[:8], whole_value[8:]


def seal_session(key: bytes, sender: int, index: bytes, counter: int, subject: str, reply: str, message: bytes) -> bytes:
    if "\n" in subject + reply:
        raise Refused("a line end")
    start = bytes([SESSION]) + sender.to_bytes(8, "big") + index + counter.to_bytes(8, "big")
    return start + encrypt(key, counter, start + f"{subject}\n{reply}".encode(), message)


def open_session(key: bytes, subject: str, reply: str, sealed: bytes) -> bytes:
    if len(sealed) < 41 or sealed[0] != SESSION:
        raise Refused("not SESSION")
    if "\n" in subject + reply:
        raise Refused("a line end")
    counter = int.from_bytes(sealed[17:25], "big")
    return decrypt(key, counter, sealed[:25] + f"{subject}\n{reply}".encode(), sealed[25:])


def ask(member: int, version: int) -> bytes:
    return head(ASK, member) + version.to_bytes(4, "big")


def read_ask(message: bytes) -> tuple[int, int]:
    """The member, and the version of its roster."""
    if len(message) != 8 or message[0] != ASK:
        raise Refused("not ASK")
    return int.from_bytes(message[1:4], "big"), int.from_bytes(message[4:], "big")


def give_roster(member: int, receiver: bytes, line: bytes) -> bytes:
    return head(ROSTER, member) + sodium.crypto_box_seal(line, x25519_of(receiver))


def take_roster(receiver: Identity, message: bytes) -> bytes:
    if not 52 < len(message) <= 52 + ROSTER_LIMIT or message[0] != ROSTER:
        raise Refused("not ROSTER")
    try:
        return sodium.crypto_box_seal_open(message[4:], receiver.dh_public, receiver.dh_secret)
    except Exception as error:
        raise Refused("sealed for somebody else") from error


class ReplayWindow:
    """Accepts each counter once, from `first` on, and none that is 1024 or more below the highest."""

    def __init__(self, first: int = 0):
        self.first, self.highest, self.seen = first, first - 1, set()

    def accept(self, counter: int) -> bool:
        if counter < self.first or counter <= self.highest - 1024 or counter in self.seen:
            return False
        self.highest = max(self.highest, counter)
        self.seen = {number for number in self.seen if number > self.highest - 1024} | {counter}
        return True
