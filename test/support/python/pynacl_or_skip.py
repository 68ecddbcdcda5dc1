# SPDX-License-Identifier: BSL-1.0
"""Makes PyNaCl importable. Without it, the test ends as skipped."""

import importlib.util
import sys

if importlib.util.find_spec("nacl") is None:
    # Debian installs python3-nacl for its own Python, which need not be the one that runs the tests.
    sys.path.append("/usr/lib/python3/dist-packages")
try:
    import nacl  # noqa: F401
except ImportError as error:
    print(f"skipped: {error} (package python3-nacl)")
    sys.exit(77)
