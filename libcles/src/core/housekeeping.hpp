// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/request_line.hpp"

namespace cles::core {

/// Whether a request is what nodes ask each other by themselves, to know who is there and what they offer: `cles` and
/// `cles/peers`. It is counted apart from the work that programs ask for.
inline bool is_housekeeping(const protocol::request_line& r) noexcept {
    const auto& noun = r.noun;
    return noun.task == "cles" &&
           (noun.parameters.empty() || (noun.parameters.size() == 1 && noun.parameters[0] == "peers"));
}

} // namespace cles::core
