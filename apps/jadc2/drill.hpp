// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>

namespace jadc2 {

struct drill_options {
    std::string at = "tcp://127.0.0.1:25374";
    std::uint64_t count = 1000;
    std::uint64_t every_us = 2000; ///< between orders
    std::string keys{};            ///< the directory with the key of a member; empty: without security
};

/// Sends orders as the mission centre does, urgently, one at a time, that end before the release; prints quantiles of
/// the time until the answer, in microseconds. \throws cles::error if one fails
int drill(const drill_options& args);

} // namespace jadc2
