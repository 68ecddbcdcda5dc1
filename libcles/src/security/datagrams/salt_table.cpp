// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/salt_table.hpp"

#include <algorithm>

namespace cles::security {

salt_table::salt_table(fleet& of)
    : fleet_(of), observation_(of.observe([this](const roster& before) { on_roster(before); })) {}

salt_table::known_salt* salt_table::find(std::uint32_t member, const group_salt& salt) {
    const auto salts = members_.find(member);
    if (salts == members_.end()) {
        return nullptr;
    }
    const auto found = std::ranges::find(salts->second, salt, &known_salt::salt);
    return found == salts->second.end() ? nullptr : &*found;
}

void salt_table::learn(std::uint32_t member, const group_salt& salt, std::uint32_t epoch, std::uint64_t first_counter) {
    if (fleet_.in_force().find(member) == nullptr) {
        return;
    }
    auto& salts = members_[member];
    if (const auto known = std::ranges::find(salts, salt, &known_salt::salt); known != salts.end()) {
        known->epoch = epoch;
        std::rotate(known, known + 1, salts.end());
        return;
    }
    if (salts.size() == salts_per_member) {
        salts.erase(salts.begin());
    }
    salts.push_back({.salt = salt,
                     .epoch = epoch,
                     .window = replay_window{first_counter},
                     .updates = replay_window{first_counter}});
}

bool salt_table::note_announcement(std::uint32_t member, known_salt& salt, std::uint64_t seq) {
    const auto counts = std::ranges::all_of(
        members_[member], [&](const known_salt& each) { return each.epoch != salt.epoch || each.announced < seq; });
    salt.announced = std::max(salt.announced, seq);
    return counts;
}

void salt_table::forget(std::uint32_t member, std::span<const std::uint8_t> beginning) {
    if (const auto salts = members_.find(member); salts != members_.end()) {
        std::erase_if(salts->second, [beginning](const known_salt& each) {
            return std::ranges::equal(beginning, std::span{each.salt}.first(beginning.size()));
        });
    }
}

void salt_table::on_roster(const roster& before) {
    for (const auto& member : before.members()) {
        if (!fleet_.in_force().has(member)) {
            members_.erase(member.number);
        }
    }
}

} // namespace cles::security
