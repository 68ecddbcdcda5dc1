// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Limits the lines that other hosts can cause in the log: one a minute for each source, or as many as are stated, and
/// for as many sources as fit. So no source silences another one, unless it has that many addresses.
class log_budget {
  public:
    static constexpr std::size_t max_sources = 64;
    static constexpr std::chrono::seconds between{60};

    explicit log_budget(std::uint32_t lines = 1) : lines_(lines) {}

    /// Returns how many lines of the source were left out since its last one, or nothing if this one is left out too.
    std::optional<std::uint64_t> take(std::string_view source, time_point now);

  private:
    struct entry {
        std::string source;
        time_point next;         // when it has all its lines again
        std::uint32_t taken = 1; // until then
        std::uint64_t left_out = 0;
    };

    std::uint32_t lines_;
    std::vector<entry> entries_;
};

} // namespace cles::core
