# SPDX-License-Identifier: BSL-1.0
"""Where a measurement leaves what it found."""

import json


def write(result, output):
    """As JSON, to a file; - is the standard output."""
    text = json.dumps(result, indent=1)
    if output == "-":
        print(text)
    else:
        with open(output, "w", encoding="utf-8") as file:
            file.write(text + "\n")
