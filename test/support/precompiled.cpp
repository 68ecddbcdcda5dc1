// SPDX-License-Identifier: BSL-1.0
// Empty: compiling this file creates the precompiled header of the test programs.
