# SPDX-License-Identifier: BSL-1.0
"""Verification of Ed25519 signatures (RFC 8032), for rosters and signed updates. Nothing here handles a private key."""

from __future__ import annotations

import hashlib
from typing import cast

_P = 2**255 - 19
_L = 2**252 + 27742317777372353535851937790883648493
_D = -121665 * pow(121666, -1, _P) % _P
_ROOT = pow(2, (_P - 1) // 4, _P)

_Point = tuple[int, int, int, int]  # extended coordinates
_ZERO: _Point = (0, 1, 1, 0)


def _add(a: _Point, b: _Point) -> _Point:
    x = (a[1] - a[0]) * (b[1] - b[0]) % _P
    y = (a[1] + a[0]) * (b[1] + b[0]) % _P
    t = 2 * a[3] * b[3] * _D % _P
    z = 2 * a[2] * b[2] % _P
    e, f, g, h = y - x, z - t, z + t, y + x
    return e * f % _P, g * h % _P, f * g % _P, e * h % _P


def _double(a: _Point) -> _Point:
    x, y, z = a[0] * a[0] % _P, a[1] * a[1] % _P, 2 * a[2] * a[2] % _P
    h = x + y
    e = h - (a[0] + a[1]) ** 2 % _P
    g = x - y
    f = z + g
    return e * f % _P, g * h % _P, f * g % _P, e * h % _P


def _decode(text: bytes) -> _Point | None:
    y = int.from_bytes(text, "little")
    sign, y = y >> 255, y & (2**255 - 1)
    if y >= _P:
        return None  # another spelling of a point
    square = (y * y - 1) * pow(_D * y * y + 1, -1, _P) % _P
    x = pow(square, (_P + 3) // 8, _P)
    if (x * x - square) % _P:
        x = x * _ROOT % _P
    if (x * x - square) % _P or (x == 0 and sign):
        return None
    if x & 1 != sign:
        x = _P - x
    return x, y, 1, x * y % _P


def _encode(point: _Point) -> bytes:
    inverse = pow(point[2], -1, _P)
    x, y = point[0] * inverse % _P, point[1] * inverse % _P
    return (y | (x & 1) << 255).to_bytes(32, "little")


_BASE: _Point = cast(_Point, _decode((4 * pow(5, -1, _P) % _P).to_bytes(32, "little")))


def is_point(key: bytes) -> bool:
    """Whether this is a point in its only encoding, and not one of the few of small order."""
    point = _decode(key) if len(key) == 32 else None
    return point is not None and _encode(_double(_double(_double(point)))) != _encode(_ZERO)


def verify(key: bytes, message: bytes, signature: bytes) -> bool:
    public = _decode(key) if len(key) == 32 and len(signature) == 64 else None
    s = int.from_bytes(signature[32:], "little")
    if public is None or s >= _L:
        return False
    digest = hashlib.sha512(signature[:32] + key + message).digest()
    h = int.from_bytes(digest, "little") % _L
    minus: _Point = (_P - public[0], public[1], 1, _P - public[3])
    both = _add(_BASE, minus)
    point = _ZERO
    for bit in range(252, -1, -1):  # s times the base, less h times the key
        point = _double(point)
        which = (s >> bit & 1) | (h >> bit & 1) << 1
        if which:
            point = _add(point, (_BASE, minus, both)[which - 1])
    return _encode(point) == signature[:32]
