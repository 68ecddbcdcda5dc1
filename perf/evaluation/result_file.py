# SPDX-License-Identifier: BSL-1.0
"""Writes the result of a measurement."""

import json


def write(result, output):
    """Writes JSON to a file; - is the standard output."""
    text = json.dumps(result, indent=1)
    if output == "-":
        print(text)
    else:
        with open(output, "w", encoding="utf-8") as file:
            file.write(text + "\n")
