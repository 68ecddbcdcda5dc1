// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <ctime> // defines __GLIBCXX__

/// The durations, points in time and clocks of `<chrono>`. The rest of it (calendars, and streams for them) is not
/// needed here, and takes every user of the library long to compile; libstdc++ has a header without it.
#if defined(__GLIBCXX__) && __has_include(<bits/chrono.h>)
#include <bits/chrono.h>
#else
#include <chrono>
#endif
