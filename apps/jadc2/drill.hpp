// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>

namespace jadc2 {

struct drill_options {
    std::string at = "tcp://127.0.0.1:25374";
    std::uint64_t count = 1000;
    std::uint64_t every_us = 2000; ///< from one order to the next
};

/// Gives orders as the mission centre does, urgently, one at a time, that end before the release; prints how long each
/// took until its answer, as quantiles in microseconds. \throws cles::error where one fails
int drill(const drill_options& wanted);

} // namespace jadc2
