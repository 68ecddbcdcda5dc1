# SPDX-License-Identifier: BSL-1.0
# Read by ctest before it runs anything. Tests run side by side, and programs take part in multicast on loopback by
# themselves: they would receive each other. Tests of multicast use separate groups.
set(ENV{CLES_MULTICAST} off)
