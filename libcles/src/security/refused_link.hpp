// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/link_admission.hpp"

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

/// The kind of its line in the log (`log_budget`). That a removed member has come back is one of its own, which
/// strangers cannot cause. The key distinguishes none: a stranger can draw a new one for each link.
std::string_view log_kind_of(link_admission::reason why) noexcept;

} // namespace cles::security
