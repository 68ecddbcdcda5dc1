// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/newer_rosters.hpp"

namespace cles::security {

newer_rosters::newer_rosters(fleet& of)
    : fleet_(of), observation_(of.observe([this](const roster& before) {
          for (const auto& member : before.members()) {
              if (!fleet_.in_force().has(member)) {
                  stated_.erase(member.number);
              }
          }
      })) {}

void newer_rosters::learn(std::uint32_t member, std::uint32_t version) {
    if (fleet_.in_force().find(member) != nullptr) {
        stated_[member].version = version;
    }
}

bool newer_rosters::has(std::uint32_t member) const {
    const auto found = stated_.find(member);
    return found != stated_.end() && found->second.version > fleet_.in_force().version();
}

bool newer_rosters::may_fetch(std::uint32_t from, time_point now) {
    if (!has(from) || now < next_fetch_) {
        return false;
    }
    auto& stated = stated_.find(from)->second;
    if (now < stated.next_fetch) {
        return false;
    }
    next_fetch_ = now + between_fetches;
    stated.next_fetch = now + between_fetches_from_one;
    return true;
}

} // namespace cles::security
