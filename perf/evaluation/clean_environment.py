# SPDX-License-Identifier: BSL-1.0
"""The environment of a program that is measured, independent of the caller's."""

import os


def clean_environment():
    """Without settings of CLES, and without a service manager that it would notify."""
    return {k: v for k, v in os.environ.items() if not k.startswith("CLES_") and k != "NOTIFY_SOCKET"}
