// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace cles::runtime {

/// What the process of an isolated plugin may use: `limits` of its entry in the configuration.
struct isolation_limits {
    std::uint64_t memory = std::uint64_t{1} << 30U; ///< bytes that the plugin may write to: heap, data and stacks
    std::uint32_t open_files = 256;
    std::vector<std::string> read{};  ///< absolute paths that it may read, besides those of the system
    std::vector<std::string> write{}; ///< absolute paths that it may read and write: data, and devices

    bool operator==(const isolation_limits&) const = default;
};
BOOST_DESCRIBE_STRUCT(isolation_limits, (), (memory, open_files, read, write))

} // namespace cles::runtime
