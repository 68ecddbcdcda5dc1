// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "security/fleet/fleet.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>

namespace cles::security {

/// Which members have stated in a session that they have a newer roster, and when this node may fetch it from one. All
/// of them may say so at once, and one roster is enough. Sans-I/O.
class newer_rosters {
  public:
    static constexpr std::chrono::milliseconds between_fetches{200};
    static constexpr std::chrono::seconds between_fetches_from_one{10};

    explicit newer_rosters(fleet& of);

    /// Takes what a member has stated last.
    void learn(std::uint32_t member, std::uint32_t version);
    /// Whether that is a later version than the one in force.
    [[nodiscard]] bool has(std::uint32_t member) const;
    /// Whether to fetch it now; if so, it counts.
    [[nodiscard]] bool may_fetch(std::uint32_t from, time_point now);

  private:
    struct stated_roster {
        std::uint32_t version = 0;
        time_point next_fetch{};
    };

    fleet& fleet_;
    std::shared_ptr<void> observation_;
    std::map<std::uint32_t, stated_roster> stated_; // by member
    time_point next_fetch_{};
};

} // namespace cles::security
