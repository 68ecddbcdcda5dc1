# SPDX-License-Identifier: BSL-1.0
"""CLES, the communication language for embedded systems: request data from other programs, delegate work to them, and
subscribe to their updates. `Node` is where to start; docs/python.md describes the package."""

from .core import VERSION as __version__
from .core import Access, Peer
from .errors import CODES, ConversionError, Error, RefusedError
from .feed import Feed, Update
from .grammar import Trace, encode_parameter
from .handlers import Request
from .limits import Limits
from .node import Node, connect
from .types import Field

__all__ = ["CODES", "Access", "ConversionError", "Error", "Feed", "Field", "Limits", "Node", "Peer", "RefusedError", "Request",
           "Trace", "Update", "__version__", "connect", "encode_parameter"]
