// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/datagram_session.hpp"
#include "security/datagrams/entropy.hpp"
#include "security/datagrams/handshake_turns.hpp"
#include "security/datagrams/hello_macs.hpp"
#include "security/fleet/fleet.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>

namespace cles::security {

/// Why a HELLO was not opened.
enum class hello_refusal : std::uint8_t {
    none,       ///< it was, or there is nothing to say
    not_member, ///< its sender is not in the roster
    unproven,   ///< it was not made with the sender's key, for this node
    busy,       ///< there were too many
};

/// The sessions for which HELLO has arrived here, and no DATA yet. Anybody can repeat a HELLO, so their number and age
/// are limited, and what HELLO stated does not count.
///
/// Whoever has no key can make HELLO at no cost, so one with a MAC is checked by that before it is opened, and a few
/// without one are opened for older nodes. The same HELLO is opened a few times, whatever addresses it comes from: the
/// first to arrive may be a copy. Such further times use up nothing of what there is for new ones.
class half_open_sessions {
  public:
    static constexpr std::size_t most = 1024;
    static constexpr std::chrono::seconds longest{10};
    static constexpr core::turn_rate share_of_member{.per_second = 8, .at_once = 16};
    /// Of HELLO without a MAC: at most 50 in any second.
    static constexpr address_turns::bounds without_mac{.share = {.per_second = 2, .at_once = 4},
                                                       .shares = {.per_second = 20, .at_once = 5},
                                                       .common = {.per_second = 20, .at_once = 5}};
    /// Of HELLO with a MAC that were opened before: as many.
    static constexpr member_turns::bounds repeated = member_bounds(50, {.per_second = 2, .at_once = 4});
    static constexpr std::uint8_t most_openings = 4; ///< of the same HELLO
    static constexpr std::size_t most_opened = 4096; ///< of which that is known

    half_open_sessions(const fleet& of, entropy& random, std::uint32_t hellos_per_second)
        : fleet_(of), random_(random), macs_(of), turns_(member_bounds(hellos_per_second, share_of_member)) {}

    /// What this node is in the session that a HELLO asks for.
    struct own_part {
        std::uint64_t index = 0; ///< new, and random
        std::uint64_t order = 0;
        node_statement stated{};
    };
    /// Opens a HELLO, with or without a MAC. The same one again has the same answer; a new one is opened only if there
    /// were few in this second. \param part called only if the HELLO is opened and new \return WELCOME, valid until the
    /// next call; null: no answer
    const hello_datagram* receive(const datagram_path& from, const datagram_head& head, bytes_view datagram,
                                  const std::function<own_part()>& part, time_point now);
    /// Why `receive` has returned null.
    [[nodiscard]] hello_refusal refused_for() const noexcept { return refused_for_; }

    [[nodiscard]] datagram_session* find(std::uint64_t index) noexcept;
    /// \pre `find` finds it
    [[nodiscard]] std::unique_ptr<datagram_session> take(std::uint64_t index);

    [[nodiscard]] std::size_t size() const noexcept { return entries_.size(); }
    [[nodiscard]] std::optional<time_point> next_deadline() const noexcept;
    void expire(time_point now);
    void forget(std::uint32_t member);
    void clear();
    [[nodiscard]] hello_macs& macs() noexcept { return macs_; }

  private:
    struct entry {
        std::unique_ptr<datagram_session> session;
        std::uint64_t key = 0; // in `hellos_`
        hello_datagram hello{};
        hello_datagram welcome{};
    };
    using entries = std::map<std::uint64_t, entry>; // by order, so the oldest is the first

    [[nodiscard]] bool may_open(const datagram_source& by, bytes_view hello, bool has_mac, time_point now);
    void note_opened(std::uint64_t hello);
    [[nodiscard]] static std::uint64_t key_of(const datagram_path& from, bytes_view hello) noexcept;
    entries::iterator erase(entries::iterator at);

    const fleet& fleet_;
    entropy& random_;
    hello_macs macs_;
    member_turns turns_; // of HELLO with a MAC that are new
    member_turns repeated_{repeated};
    address_turns without_mac_{without_mac};
    entries entries_;
    boost::unordered_flat_map<std::uint64_t, std::uint64_t> hellos_;  // key of a HELLO -> order
    boost::unordered_flat_map<std::uint64_t, std::uint64_t> indices_; // own index -> order
    boost::unordered_flat_map<std::uint64_t, std::uint8_t> opened_;   // how often each of the last HELLO was opened
    std::deque<std::uint64_t> opened_order_;
    hello_refusal refused_for_ = hello_refusal::none;
};

} // namespace cles::security
