# SPDX-License-Identifier: BSL-1.0
"""Accounts and users of a NATS server in operator mode: each has a key, and a JWT that the one above has signed."""

import base64
import binascii
import json
import time

import pynacl_or_skip  # noqa: F401
from nacl.signing import SigningKey

_SEED = 18 << 3
_KINDS = {"operator": 14 << 3, "account": 0, "user": 20 << 3}
_NO_LIMIT = -1


def _encoded(data):
    """Base32 with a checksum."""
    checksum = binascii.crc_hqx(data, 0).to_bytes(2, "little")
    return base64.b32encode(data + checksum).rstrip(b"=").decode()


def _base64url(data):
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


class _Holder:
    """Has a key, and a JWT from `issuer`; an operator signs its own."""

    def __init__(self, kind, name, issuer=None, claims=None, expires=None):
        self.key = SigningKey.generate()
        prefix = _KINDS[kind]
        self.id = _encoded(bytes([prefix]) + bytes(self.key.verify_key))
        self.seed = _encoded(bytes([_SEED | prefix >> 5, (prefix & 31) << 3]) + bytes(self.key))
        now = int(time.time())
        stated = {"jti": f"{name} {now}", "iat": now, "iss": (issuer or self).id, "name": name, "sub": self.id,
                  "nats": {"type": kind, "version": 2, **(claims or {})}}
        if expires is not None:
            stated["exp"] = int(expires)
        text = ".".join(_base64url(json.dumps(part).encode())
                        for part in ({"typ": "JWT", "alg": "ed25519-nkey"}, stated))
        self.jwt = f"{text}.{_base64url((issuer or self).key.sign(text.encode()).signature)}"


class User(_Holder):
    def __init__(self, account, name, expires=None):
        super().__init__("user", name, account,
                         {"pub": {}, "sub": {}, "subs": _NO_LIMIT, "data": _NO_LIMIT, "payload": _NO_LIMIT}, expires)

    def credentials(self):
        """The text of its file."""
        return (f"-----BEGIN NATS USER JWT-----\n{self.jwt}\n------END NATS USER JWT------\n\n"
                f"-----BEGIN USER NKEY SEED-----\n{self.seed}\n------END USER NKEY SEED------\n")


class Account(_Holder):
    def __init__(self, operator, name):
        limits = dict.fromkeys(("subs", "data", "payload", "imports", "exports", "conn", "leaf"), _NO_LIMIT)
        super().__init__("account", name, operator, {"limits": {**limits, "wildcards": True}})


class Operator(_Holder):
    def __init__(self, name):
        super().__init__("operator", name)

    def configuration(self, *accounts):
        """Of a server that knows these accounts."""
        known = ", ".join(f"{account.id}: {account.jwt}" for account in accounts)
        return f"operator: {self.jwt}\nresolver: MEMORY\nresolver_preload: {{{known}}}\n"
