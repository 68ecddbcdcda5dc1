# SPDX-License-Identifier: BSL-1.0
"""The environment of a program that is measured: without what the caller's own would tell it."""

import os


def clean_environment():
    """Without settings of CLES, and without a service manager that would be told that it is ready."""
    return {k: v for k, v in os.environ.items() if not k.startswith("CLES_") and k != "NOTIFY_SOCKET"}
