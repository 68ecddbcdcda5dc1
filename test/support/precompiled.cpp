// SPDX-License-Identifier: BSL-1.0
// Holds nothing: the precompiled header of the test programs is made as this file is compiled.
