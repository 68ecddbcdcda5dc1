// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>

namespace sysinfo {

struct utc {
    double seconds = 0; ///< since 1970, leap seconds left out
    std::string text;   ///< "2026-11-21T20:13:36.123456Z" (RFC 3339)
};
BOOST_DESCRIBE_STRUCT(utc, (), (seconds, text))

/// \param nanoseconds since 1970
utc utc_at(std::int64_t nanoseconds);

/// What the clock of this machine says.
utc read_utc();

} // namespace sysinfo
