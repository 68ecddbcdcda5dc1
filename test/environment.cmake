# SPDX-License-Identifier: BSL-1.0
# Read by ctest before it runs anything. Tests run side by side, and programs take part in multicast on loopback by
# themselves: they would hear each other. Tests of multicast name a group of their own.
set(ENV{CLES_MULTICAST} off)
