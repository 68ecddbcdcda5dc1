// SPDX-License-Identifier: BSL-1.0

// The compiled part of Boost.JSON, for those who cannot link a static library that was made for programs.
#include <boost/json/src.hpp>
