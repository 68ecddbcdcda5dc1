// SPDX-License-Identifier: BSL-1.0
#pragma once

/// Stops compilation with an older language standard at the first line, before the compiler reports errors in all
/// others.

#if __cplusplus < 202002L
#error CLES needs C++20: compile with -std=c++20 or later (CMake: target_compile_features(... cxx_std_20))
#define CLES_END_HERE "nothing more is compiled"
#include CLES_END_HERE
#endif
