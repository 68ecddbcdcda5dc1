// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "security/link_admission.hpp"

#include <chrono>
#include <cstddef>
#include <deque>
#include <map>
#include <string>
#include <string_view>

namespace cles::security {

/// A link that was not opened.
struct refused_link {
    link_admission::reason kind = link_admission::reason::none;
    std::string_view source{}; ///< the host of the other end, or another name for it
    std::string_view why{};    ///< for people
    std::string_view key{};    ///< which the other end has proved that it has, as in NAME.pub; empty: none
};

/// "the other end's key is not in roster 3 (10.0.0.7, key nJ3...)"
std::string text_of(const refused_link& link);

/// Which refusals of links are logged. Others decide how often they try and what they say, so each is logged once a
/// minute, and only some of a source and of a kind. What one kind or source uses up is not missing to the others.
class refused_links {
  public:
    static constexpr std::chrono::minutes log_again_after{1};
    static constexpr std::size_t most_of_kind = 32;
    static constexpr std::size_t most_of_source = 4; ///< and kind

    /// Whether it is to be logged now.
    bool take(const refused_link& link, time_point now);

  private:
    struct logged_one {
        std::string source;
        std::string why;
        std::string key;
        time_point at{};
    };

    std::map<link_admission::reason, std::deque<logged_one>> logged_; // of each kind, the oldest first
};

} // namespace cles::security
