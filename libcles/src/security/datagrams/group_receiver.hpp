// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_port.hpp"
#include "security/datagrams/datagram_format.hpp"
#include "security/datagrams/datagram_path.hpp"
#include "security/datagrams/entropy.hpp"
#include "security/datagrams/rate_limit.hpp"
#include "security/datagrams/salt_table.hpp"
#include "security/fleet/fleet.hpp"

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

namespace cles::security {

class group_sender;

/// Opens what arrives from the multicast group (docs/security.md, "In the multicast group"). Sans-I/O; allocates
/// nothing while no salt is new.
///
/// A line is received in two steps, because its counter is noted only when the source has been checked too: `open`,
/// then the checks of the node, then `accept`.
class group_receiver {
  public:
    /// \param own what this node sends itself is dropped
    group_receiver(fleet& of, group_sender& own, entropy& random);

    /// Takes what a member has stated in a session.
    void learn(std::uint32_t member, const node_statement& stated);

    enum class verdict : std::uint8_t {
        dropped,
        opened,       ///< the line may be accepted
        unknown_salt, ///< dropped; the line is authentic, and perhaps old
    };
    /// A datagram that was opened, to be accepted or not.
    struct ticket {
        std::uint32_t member = 0;
        group_salt salt{};
        std::uint64_t counter = 0;
    };
    struct result {
        verdict what = verdict::dropped;
        std::string_view line{}; ///< unless it was dropped; valid until the next call
        std::uint32_t epoch = 0; ///< of the sender, if it was opened
        ticket accepted_by{};    ///< for `accept`, if it was opened
        /// The caller now sends HELLO there (`datagram_sessions::contact`), to learn of a salt or a newer roster.
        std::optional<datagram_source> contact{};
    };
    result open(const datagram_path& from, bytes_view datagram, time_point now);

    enum class ordered_by : std::uint8_t {
        counter,
        signed_seq, ///< an update whose signature has been verified: its `seq` decides, and no counter is noted
    };
    /// Whether a line that was opened counts. \pre its source has been checked
    [[nodiscard]] bool accept(const ticket& t, ordered_by order);
    /// The same for an announcement whose signature has been verified, too.
    [[nodiscard]] core::datagram_admission::repetition accept_announcement(const ticket& t, std::uint64_t seq);

  private:
    struct recent_contact {
        datagram_source source;
        time_point at;
    };

    [[nodiscard]] bool may_contact(const datagram_source& source, time_point now);
    [[nodiscard]] std::optional<datagram_source> newer_roster(const datagram_source& source, time_point now);

    fleet& fleet_;
    group_sender& own_;
    entropy& random_;
    std::shared_ptr<void> observation_;
    salt_table salts_;
    rate_limit contacts_{50};
    std::deque<recent_contact> contacted_; // in this second
    rate_limit roster_contacts_{10};
    std::vector<datagram_source> newer_; // some sources of datagrams of later generations
    std::array<std::uint8_t, max_line> opened_{};
};

} // namespace cles::security
