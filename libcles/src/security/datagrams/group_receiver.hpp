// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_port.hpp"
#include "security/datagrams/datagram_format.hpp"
#include "security/datagrams/datagram_path.hpp"
#include "security/datagrams/entropy.hpp"
#include "security/datagrams/handshake_turns.hpp"
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

/// Opens what arrives from the multicast group (docs/protocol_security.md, "In the multicast group"). Sans-I/O;
/// allocates nothing while no salt is new.
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
        /// There may be a member whose roster is so old that its group keys are refused. The caller tells it where
        /// this node is, which has a newer one.
        std::optional<datagram_source> outdated{};
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
    /// Those of the last second.
    template <class Source>
    class recent {
      public:
        [[nodiscard]] bool contains(const Source& which, time_point now);
        void add(const Source& which, time_point now) { all_.push_back({.which = which, .at = now}); }

      private:
        struct entry {
            Source which;
            time_point at;
        };
        std::deque<entry> all_; // oldest first
    };

    /// Some sources of datagrams that cannot be opened because of their generation, so that nobody can tell whether
    /// they are authentic.
    using unverified_sources = std::vector<datagram_source>;

    [[nodiscard]] bool may_contact(const datagram_source& source, time_point now);
    [[nodiscard]] std::optional<datagram_source> choose(unverified_sources& among, const datagram_source& latest,
                                                        time_point now);

    fleet& fleet_;
    group_sender& own_;
    entropy& random_;
    std::shared_ptr<void> observation_;
    salt_table salts_;
    member_turns contacts_{member_bounds(50, {.per_second = 2, .at_once = 2})}; // old datagrams can be repeated
    recent<datagram_source> contacted_;
    unverified_sources newer_; // of later generations
    unverified_sources older_; // of earlier generations
    rate_limit choices_{10};   // of both
    recent<datagram_path> chosen_;
    std::array<std::uint8_t, max_line> opened_{};
};

} // namespace cles::security
