// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/datagram_format.hpp"
#include "security/datagrams/replay_window.hpp"
#include "security/fleet/fleet.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace cles::security {

/// Under which salts members seal with the group key, and what has been received under each. Salts of a member that is
/// removed or changed are forgotten.
class salt_table {
  public:
    /// A member has several if several processes use its key; the newest ones count.
    static constexpr std::size_t salts_per_member = 8;

    struct known_salt {
        group_salt salt;
        std::uint32_t epoch;
        replay_window window;
        replay_window updates;       ///< of messages that may overtake all others
        std::uint64_t announced = 0; ///< the greatest signed `seq` of an announcement that has counted
    };

    explicit salt_table(fleet& of);

    /// Null if the salt is not known. Valid until a salt is learnt or the roster changes.
    [[nodiscard]] known_salt* find(std::uint32_t member, const group_salt& salt);
    /// Takes a salt of a member as its newest one. The window of a known one stays: it knows what has been received.
    void learn(std::uint32_t member, const group_salt& salt, std::uint32_t epoch, std::uint64_t first_counter);

    /// Notes the signed `seq` of an announcement under a known salt. Returns whether it is greater than all others of
    /// that member and epoch, whatever their salt: any member can seal as another one, but not sign.
    [[nodiscard]] bool note_announcement(std::uint32_t member, known_salt& salt, std::uint64_t seq);

    /// Forgets the salts of a member that begin so.
    void forget(std::uint32_t member, std::span<const std::uint8_t> beginning);

  private:
    void on_roster(const roster& before);

    fleet& fleet_;
    std::shared_ptr<void> observation_;
    boost::unordered_flat_map<std::uint32_t, std::vector<known_salt>> members_; // by number; the newest salt is last
};

} // namespace cles::security
