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

/// Limits the lines that others can cause in the log. What one kind of line or one source uses up is not missing to
/// others, so nobody silences anybody else, unless he has as many addresses as there are sources of a kind.
class log_budget {
  public:
    static constexpr std::size_t max_sources = 64; ///< of a kind
    static constexpr std::chrono::seconds between{60};

    struct line {
        std::string_view kind;     ///< one of a few literals
        std::string_view source{}; ///< who has caused it
        std::string_view text{};   ///< a second line with it is left out; empty: it is compared with none
        std::uint32_t most = 1;    ///< of this kind and source
        std::chrono::seconds in = between;
    };
    /// Returns how many lines of the source were left out before, since its last ones, or nothing if this one is left
    /// out too.
    std::optional<std::uint64_t> take(const line& l, time_point now);

  private:
    struct entry {
        std::string_view kind;
        std::string source;
        time_point next{};       // when it has all its lines again
        std::uint32_t taken = 0; // until then
        std::vector<std::string> texts{};
        std::uint64_t left_out = 0;
    };

    entry* find(const line& l, time_point now);

    std::vector<entry> entries_;
};

/// " (and 3 since the last such line)"; empty if there are none.
std::string left_out_text(std::uint64_t lines);

} // namespace cles::core
