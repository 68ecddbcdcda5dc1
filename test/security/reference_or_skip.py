# SPDX-License-Identifier: BSL-1.0
"""The reference implementation, as `r`, and PyNaCl's bindings, as `sodium`. Without PyNaCl, the test ends as skipped."""

import sys

try:
    import nacl  # noqa: F401
except ImportError:
    # Debian installs python3-nacl for its own Python, which need not be the one that runs the tests.
    sys.path.append("/usr/lib/python3/dist-packages")
try:
    import reference as r  # noqa: F401
except ImportError as error:
    print(f"skipped: {error} (package python3-nacl)")
    sys.exit(77)
from nacl import bindings as sodium  # noqa: F401
