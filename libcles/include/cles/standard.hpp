// SPDX-License-Identifier: BSL-1.0
#pragma once

/// Stops compilation with an older language standard, or without exceptions, at the first line, before the compiler
/// reports errors in all others. With other settings than the library's, a program does not link.

#if __cplusplus < 202002L
#error CLES needs C++20: compile with -std=c++20 or later (CMake: target_compile_features(... cxx_std_20))
#define CLES_END_HERE "nothing more is compiled"
#include CLES_END_HERE
#endif

#if !defined(__cpp_exceptions)
#error CLES needs exceptions: compile without -fno-exceptions
#define CLES_END_HERE "nothing more is compiled"
#include CLES_END_HERE
#endif

#include <cles/build_settings.hpp>
