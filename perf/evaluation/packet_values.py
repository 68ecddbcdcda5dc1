# SPDX-License-Identifier: BSL-1.0
"""How the values of the localization packet are written: `cles bench --bytes` counts both."""

ROUNDED = "values rounded to ms, 1e-6 degrees, mm/s and mm/s\u00b2"
UNROUNDED = "values with all digits of a double"
