// SPDX-License-Identifier: BSL-1.0

// The compiled part of Boost.JSON, for targets that cannot link a static library that was built for programs.
#include <boost/json/src.hpp>
