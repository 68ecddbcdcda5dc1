// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/presence.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace cles::core {

/// Nodes that take no part in gossip, and announce themselves to a group that is heard here: all that they could tell
/// is known without asking them.
class plain_nodes {
  public:
    static constexpr int intervals_apart = 60; ///< until one is looked at again

    /// True where it is one, and is to be left alone from now on.
    bool add(const presence& others, std::string_view node, time_point until, time_point now);
    [[nodiscard]] bool contain(const presence::known& k, time_point now) const;
    /// How many of the others may be asked.
    [[nodiscard]] std::size_t worth_asking(const presence& others, time_point now) const;

  private:
    struct entry {
        std::uint32_t epoch = 0;
        time_point until{};
    };
    std::map<std::string, entry, std::less<>> all_;
};

} // namespace cles::core
