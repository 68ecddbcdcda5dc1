# SPDX-License-Identifier: BSL-1.0
"""The reference implementation, as `r`, and PyNaCl's bindings, as `sodium`. Without PyNaCl, the test ends as skipped."""

import pynacl_or_skip  # noqa: F401
import reference as r  # noqa: F401
from nacl import bindings as sodium  # noqa: F401
