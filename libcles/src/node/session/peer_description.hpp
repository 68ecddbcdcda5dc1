// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

/// What a node states about itself in the reply to `PULL self:cles`, as far as it concerns what is sent to it.
struct peer_description {
    /// Every node reads lines of this size, without their LF.
    static constexpr std::size_t least_line = 256;

    std::string node{};                ///< its name; empty if it states none that is valid
    bool marks = false;                ///< it has the feature `mark`
    std::optional<std::size_t> line{}; ///< the longest line that it reads, without its LF; nothing: not stated

    /// What cannot be read counts as not stated.
    static peer_description read(std::string_view json);

    bool operator==(const peer_description&) const = default;
};

} // namespace cles::core
