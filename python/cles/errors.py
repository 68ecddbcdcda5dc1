# SPDX-License-Identifier: BSL-1.0
"""Failures, as the protocol names them (docs/protocol.md, "Errors")."""

from __future__ import annotations

from typing import Any

#: The codes that are sent to peers.
CODES = (
    "bad_request", "denied", "no_target", "no_task", "too_large", "cancelled", "failed", "unavailable", "busy", "deadline",
)
DEFAULT_RETRY_MS = 100


class Error(Exception):
    """A request that failed; thrown by a handler, the failure that its requester gets.

    `code` is one of `CODES`. `details` has the further members of a peer's failure, such as `challenge`.
    """

    def __init__(self, code: str, message: str = "", *, ran: bool = False, retry_ms: int | None = None,
                 details: dict[str, Any] | None = None) -> None:
        super().__init__(f"{code}: {message}")
        self.code = code if code in CODES else "failed"  # a later version may know more
        self.message = message
        self.ran = ran  # the work has been done, although there is no result
        self.retry_ms = retry_ms
        self.details = details or {}


class ConversionError(ValueError):
    """A value that does not fit its type; the message begins with the path of the member."""


class RefusedError(ValueError):
    """Something that this program does not permit, or cannot do: a URL, a name, a key."""


def failure_of(reply: dict[str, Any]) -> Error:
    """The failure in a reply that begins with `{"error":"`."""
    code = reply.get("error")
    message = reply.get("message")
    retry = reply.get("retry_ms")
    known = {"error", "message", "ran", "retry_ms"}
    return Error(code if isinstance(code, str) else "failed", printable(message) if isinstance(message, str) else "",
                 ran=reply.get("ran") is True,
                 retry_ms=retry if isinstance(retry, int) and not isinstance(retry, bool) else None,
                 details={key: value for key, value in reply.items() if key not in known})


def printable(text: str) -> str:
    """Text of a peer, fit for a terminal: without control characters."""
    return text if text.isprintable() else "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
