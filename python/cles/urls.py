# SPDX-License-Identifier: BSL-1.0
"""Addresses of links (docs/links.md)."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from typing import Final, Literal, cast

from .errors import RefusedError

DEFAULT_PORT: Final = 25370
Scheme = Literal["tcp", "tls", "udp", "unix"]

_IP = re.compile(r"(?:\[([0-9A-Fa-f:.]+(?:%25[A-Za-z0-9_.\-]+)?)\]|([A-Za-z0-9_.\-]+))(?::([0-9]{1,5}))?(?:\?dscp=([0-9]{1,2}))?")


@dataclass(frozen=True, slots=True)
class Url:
    scheme: Scheme
    host: str = ""
    port: int = DEFAULT_PORT
    path: str = ""  # of unix; an abstract one begins with a zero byte
    dscp: int = 0

    @property
    def is_local(self) -> bool:
        """Whether only programs of this host can reach it."""
        if self.scheme == "unix" or self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host.partition("%")[0]).is_loopback
        except ValueError:
            return False

    def with_port(self, port: int) -> str:
        host = f"[{self.host.replace('%', '%25')}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{port}" + (f"?dscp={self.dscp}" if self.dscp else "")


def parse_url(text: str) -> Url:
    scheme, separator, rest = text.partition("://")
    if scheme == "unix" and separator and rest[:1] in ("/", "@") and len(rest) > 1:
        if len(rest.encode()) > 107:
            raise RefusedError(f"'{text}': a Unix socket's path has at most 107 bytes")
        return Url("unix", path="\0" + rest[1:] if rest.startswith("@") else rest)
    found = _IP.fullmatch(rest)
    if scheme not in ("tcp", "tls", "udp") or not found:
        raise RefusedError(f"'{text}' is not an address: tcp://host:port, tls://host:port, udp://host:port, unix:///path")
    v6, name, port, dscp = found.groups()
    number = int(port) if port else DEFAULT_PORT
    mark = int(dscp) if dscp else 0
    if number > 65535 or mark > 63:
        raise RefusedError(f"'{text}': a port is at most 65535, a DSCP at most 63")
    return Url(cast(Scheme, scheme), (v6 or name).replace("%25", "%"), number, dscp=mark)
