# SPDX-License-Identifier: BSL-1.0
"""The key directory of a member of a fleet, its roster, and who may do what (docs/protocol_security.md)."""

from __future__ import annotations

import base64
import fcntl
import json
import os
import secrets
import ssl
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import ed25519, grammar, jsontext
from .core import Peer
from .errors import Error, RefusedError
from .grammar import Request
from .rights import Rights, Rules, is_exempt, is_name_pattern, matches, parse_rules
from .signer import Signer

LONGEST_ROSTER = 1_000_000  # bytes
_START = '{"signature":"'
_MIDDLE = '","roster":'
_CONTENT_AT = len(_START) + 86 + len(_MIDDLE)
_KEY_INFO = bytes.fromhex("302a300506032b6570032100")  # how a certificate states that what follows is an Ed25519 key


def to_base64url(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


def read_base64url(text: Any, size: int) -> bytes:
    """Refuses any other size, and other spellings of the same bytes."""
    try:
        data = base64.urlsafe_b64decode(text + "=" * (-len(text) % 4)) if isinstance(text, str) else b""
    except ValueError:
        data = b""
    if len(data) != size or to_base64url(data) != text:
        raise RefusedError(f"expected {size} bytes as base64url")
    return data


# --- The roster --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Member:
    number: int
    name: str
    key: bytes
    may: Rights
    offers: Rights
    forwards: tuple[str, ...]


class Roster:
    """A roster whose signature has been verified."""

    def __init__(self, line: str, fleet: bytes, version: int, members: list[Member]) -> None:
        self.line = line
        self.fleet = fleet
        self.version = version
        self.by_name = {member.name: member for member in members}
        self.by_key = {member.key: member for member in members}

    @property
    def fleet_text(self) -> str:
        return to_base64url(self.fleet)


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) != len(pairs):
        raise RefusedError("the roster is malformed: a key occurs twice")
    return made


def _whole(value: Any, what: str, low: int, high: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise RefusedError(f"the roster is malformed: {what}: expected a whole number from {low} to {high}")
    return value


def _texts(value: Any, what: str) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
        raise RefusedError(f"the roster is malformed: {what}: expected an array of strings")
    return value


def _check_unknown(keys: Any, what: str) -> None:
    if any(key.startswith("must_") for key in keys):
        raise RefusedError(f"the roster is malformed: {what}: this version does not know a key that begins with 'must_'")


def read_roster(line: str, fleet: bytes | None = None) -> Roster:
    """Without `fleet`, the roster is trusted to name its fleet, as the first in a node's directory is."""
    content = line[_CONTENT_AT:-1]
    if not line.startswith(_START) or line[_CONTENT_AT - len(_MIDDLE):_CONTENT_AT] != _MIDDLE or "\n" in line or \
            not (content.startswith("{") and line.endswith("}}")) or len(line.encode()) > LONGEST_ROSTER:
        raise RefusedError('a roster is a line of the form {"signature":"<86 characters>","roster":{...}}')
    signature = read_base64url(line[len(_START):len(_START) + 86], 64)
    if fleet is None:
        fleet = read_base64url(_parse(content).get("fleet"), 32)
    if not ed25519.verify(fleet, b"cles roster 1\n" + content.encode(), signature):
        raise RefusedError("the roster is not signed by the fleet's key")
    told = _parse(content)
    if read_base64url(told.get("fleet"), 32) != fleet:
        raise RefusedError("the roster is of another fleet")
    _check_unknown(told, "the roster")
    generation = _whole(told.get("generation"), "generation", 1, 2**32 - 2)
    if _whole(told.get("oldest"), "oldest", 1, 2**32 - 2) not in (generation, generation - 1):
        raise RefusedError("the roster is malformed: 'oldest' is neither the generation nor the one before")
    last = _whole(told.get("last"), "last", 0, 2**24 - 1)
    members = [_read_member(_object(each)) for each in told.get("members", ())]
    numbers = [member.number for member in members]
    if numbers != sorted(set(numbers)) or (numbers and numbers[-1] > last) or len(members) > 4096:
        raise RefusedError("the roster is malformed: the members are not in ascending order of their numbers up to 'last'")
    roster = Roster(line, fleet, _whole(told.get("version"), "version", 1, 2**32 - 1), members)
    if "members" not in told or len(roster.by_name) != len(members) or len(roster.by_key) != len(members):
        raise RefusedError("the roster is malformed: two members have one name or key, or there is no list of them")
    return roster


def _parse(content: str) -> dict[str, Any]:
    try:
        jsontext.read(content)  # which limits the depth
    except jsontext.Invalid as error:
        raise RefusedError(f"the roster is malformed: {error}") from None
    return _object(json.loads(content, object_pairs_hook=_without_repeats))


def _object(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise RefusedError("the roster is malformed: expected an object")
    return value


def _read_member(told: dict[str, Any]) -> Member:
    name = told.get("name")
    if not isinstance(name, str) or not grammar.is_name(name) or name in ("self", "any", "all"):
        raise RefusedError("the roster is malformed: a member without a valid name")
    _check_unknown(told, name)
    # Whether it is of prime order concerns those who agree on secrets with it; here it is only compared.
    key = read_base64url(told.get("key"), 32)
    return Member(_whole(told.get("number"), "number", 1, 2**24 - 1), name, key,
                  Rights(_texts(told["may"], "may") if "may" in told else None),
                  Rights(_texts(told["offers"], "offers") if "offers" in told else None),
                  tuple(filter(is_name_pattern, _texts(told.get("forwards", []), "forwards"))))


# --- The directory -----------------------------------------------------------------------------------------------------


def _open(path: Path, *, secret: bool = False) -> int:
    """A file of a key directory: of this user or root, and of nobody else's to change."""
    file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    status = os.fstat(file)
    why = ""
    if not stat.S_ISREG(status.st_mode):
        why = "is not a regular file"
    elif status.st_uid not in (0, os.geteuid()):
        why = "belongs to another user"
    elif secret and status.st_mode & 0o077:
        why = f"is accessible to other users: chmod 600 {path}"
    elif status.st_mode & 0o022:
        why = f"can be changed by other users: chmod go-w {path}"
    if why:
        os.close(file)
        raise RefusedError(f"{path} {why}")
    return file


def _read(path: Path, most: int) -> bytes | None:
    try:
        file = _open(path)
    except FileNotFoundError:
        return None
    with os.fdopen(file, "rb") as stream:
        data = stream.read(most + 1)
    if len(data) > most:
        raise RefusedError(f"{path} has more than {most} bytes")
    return data


def key_in_certificate(der: bytes) -> bytes:
    """The Ed25519 key of an X.509 certificate. Only the place where a certificate has its key counts."""
    def element(at: int, tag: int) -> tuple[int, int]:
        """Where the content of the element at this place begins and ends."""
        if len(der) < at + 2 or der[at] != tag:
            raise RefusedError("the certificate is malformed")
        size, at = der[at + 1], at + 2
        if size >= 0x80:
            count = size & 0x7F
            size = int.from_bytes(der[at:at + count], "big")
            if not 1 <= count <= 3 or size < 0x80 or der[at] == 0:
                raise RefusedError("the certificate is malformed")
            at += count
        if at + size > len(der):
            raise RefusedError("the certificate is malformed")
        return at, at + size

    at, _ = element(element(0, 0x30)[0], 0x30)  # what is signed
    for tag in (0xA0, 0x02, 0x30, 0x30, 0x30, 0x30):  # version, serial number, algorithm, issuer, validity, subject
        at = element(at, tag)[1]
    end = element(at, 0x30)[1]
    if end - at != len(_KEY_INFO) + 32 or der[at:at + len(_KEY_INFO)] != _KEY_INFO:
        raise RefusedError("the certificate has no Ed25519 key")
    return der[end - 32:end]


class Fleet:
    """What this node knows of its fleet. `changed` is called with the former roster when a newer one is in force."""

    def __init__(self, directory: str | os.PathLike[str]) -> None:
        self.directory = Path(directory)
        status = self.directory.stat()
        if status.st_uid not in (0, os.geteuid()) or status.st_mode & 0o022:
            raise RefusedError(f"{self.directory} can be changed by other users: chmod go-w {self.directory}")
        self.changed: list[Callable[[Roster], None]] = []
        self.rules = Rules()
        self._state: list[Any] = []
        self._signer: Signer | None = None
        roster = self._read_newest()
        if roster is None:
            raise RefusedError(f"{self.directory} contains no roster: put NAME.join there, which 'cles fleet add' writes")
        self.roster = roster
        self.own_key = self._read_own_key()
        own = self.roster.by_key.get(self.own_key)
        if own is None:
            raise RefusedError(f"the key in {self.directory} is not in version {roster.version} of the roster")
        self.name = own.name
        self.check_files()

    def _read_newest(self) -> Roster | None:
        newest: Roster | None = None
        for path in [self.directory / "roster", *sorted(self.directory.glob("[!.]*.join"))]:
            data = _read(path, LONGEST_ROSTER + 1)
            if data is None:
                continue
            try:
                read = read_roster(data.decode().removesuffix("\n"), newest.fleet if newest else None)
            except ValueError as error:
                raise RefusedError(f"{path}: {error}") from None
            if newest is None or read.version > newest.version:
                newest = read
        return newest

    @property
    def certificate(self) -> Path:
        return self.directory / "tls.pem"

    def _read_own_key(self) -> bytes:
        """The public one, of the certificate."""
        try:
            file = _open(self.certificate, secret=True)
        except FileNotFoundError:
            raise RefusedError(f"{self.certificate} does not exist: 'cles keys cert --keys {self.directory}' writes it") from None
        with os.fdopen(file, "r", encoding="ascii") as stream:
            text = stream.read(65_536)
        begin, end = text.find("-----BEGIN CERTIFICATE-----"), text.find("-----END CERTIFICATE-----")
        if begin < 0 or end < begin:
            raise RefusedError(f"{self.certificate} contains no certificate")
        return key_in_certificate(ssl.PEM_cert_to_DER_cert(text[begin:end + len("-----END CERTIFICATE-----")]))

    def context(self) -> ssl.SSLContext:
        """For links that this node opens. The key at the other end is compared with the roster when the handshake is
        complete (`Admission`), so there is no chain to verify."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        context.set_alpn_protocols(["cles/1"])
        file = _open(self.certificate, secret=True)
        try:
            context.load_cert_chain(f"/proc/self/fd/{file}")  # the file that was checked
        finally:
            os.close(file)
        return context

    # --- Signatures of this node ---

    def _sign(self, *lines: str) -> str:
        if self._signer is None:
            with os.fdopen(_open(self.certificate, secret=True), "rb") as stream:
                self._signer = Signer(stream.read(65_536))
        return to_base64url(self._signer.sign("".join(f"{line}\n" for line in lines).encode()))

    def sign_update(self, noun: str, seq: int, epoch: str, body: str) -> str:
        return self._sign("cles update 1", self.roster.fleet_text, self.name, noun, f"{seq} {epoch}", body)

    def sign_request(self, node: str, challenge: str, verb: str, noun: str, body: str, waits_ms: int) -> str:
        """The value of `sig`."""
        return self._sign("cles request 2", self.roster.fleet_text, self.name, node, challenge, f"{verb} {noun}", body or "{}",
                          str(waits_ms), "") + f".{waits_ms}"

    # --- Which roster is in force ---

    def offer(self, line: str) -> None:
        """Puts a newer roster into force, and stores it. Raises `RefusedError` if it is not valid."""
        if line == self.roster.line:
            return
        read = read_roster(line, self.roster.fleet)
        if read.version <= self.roster.version:
            return
        former, self.roster = self.roster, read
        self._store(read)
        for changed in list(self.changed):
            changed(former)

    def _store(self, roster: Roster) -> None:
        path = self.directory / "roster"
        try:
            with open(self.directory / ".roster.lock", "a", opener=lambda name, flags: os.open(
                    name, flags | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)) as guard:
                fcntl.flock(guard, fcntl.LOCK_EX)
                stored = _read(path, LONGEST_ROSTER + 1)
                if stored is not None and \
                        read_roster(stored.decode().removesuffix("\n"), roster.fleet).version >= roster.version:
                    return
                made = self.directory / f".roster.{secrets.token_urlsafe(12)}"
                file = os.open(made, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
                with os.fdopen(file, "wb") as stream:
                    stream.write(roster.line.encode() + b"\n")
                    stream.flush()
                    os.fsync(file)
                os.replace(made, path)
        except (OSError, ValueError):
            pass  # it is in force nevertheless; others may bring it again

    def check_files(self) -> None:
        """Reads the roster and the rules again if they have changed."""
        state: list[Any] = []
        for name in ("roster", "rules"):
            try:
                status = (self.directory / name).lstat()
                state.append((status.st_ino, status.st_size, status.st_mtime_ns, status.st_mode, status.st_uid))
            except FileNotFoundError:
                state.append(None)
        if state == self._state:
            return
        self._state = state
        try:
            text = _read(self.directory / "rules", 65_536)
            self.rules = parse_rules(text) if text is not None else Rules()
        except (OSError, RefusedError) as error:
            self.rules = Rules(error=str(error))
        data = None
        try:
            data = _read(self.directory / "roster", LONGEST_ROSTER + 1)
            if data is not None:
                self.offer(data.decode().removesuffix("\n"))
        except (OSError, ValueError):
            pass  # the one in force stays

    # --- Who may do what ---

    @property
    def version(self) -> int:
        return self.roster.version

    @property
    def roster_line(self) -> str:
        return self.roster.line

    def requester(self, peer: Peer, request: Request) -> str:
        return request.sender or peer.name

    def refusal(self, peer: Peer, request: Request) -> Error | None:
        """Why a request of a peer is denied; None if it is not."""
        noun = request.noun
        requester = self.requester(peer, request)
        if request.sender and not may_forward(self.roster, peer.name, request.sender):
            return Error("denied", f"{peer.name} may not forward requests of {grammar.quoted(request.sender)}")
        is_own = requester == self.name and not request.sender and self.name in self.roster.by_name
        if is_own or permits(self.roster, self.rules, self.name, requester, request.verb, noun):
            return None
        return Error("denied", f"{self.name} does not allow {request.verb} {grammar.quoted(noun.path)}")


def permits(roster: Roster, rules: Rules, own: str, requester: str, verb: str, noun: grammar.Noun) -> bool:
    """Whether a member may request that of the node `own`."""
    asking, asked = roster.by_name.get(requester), roster.by_name.get(own)
    if asking is None or asked is None:
        return False
    if is_exempt(noun):
        return True
    rule = None if rules.error else rules.find(requester, verb, own, noun)
    return not rules.error and (rule is None or rule.allows) and asking.may.permits(verb, own, noun) and \
        asked.offers.permits(verb, own, noun)


def may_forward(roster: Roster, forwarder: str, requester: str) -> bool:
    by = roster.by_name.get(forwarder)
    return by is not None and requester in roster.by_name and \
        (forwarder == requester or any(matches(pattern, requester) for pattern in by.forwards))
