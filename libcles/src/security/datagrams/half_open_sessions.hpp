// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/datagram_session.hpp"
#include "security/datagrams/entropy.hpp"
#include "security/datagrams/rate_limit.hpp"
#include "security/fleet/fleet.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>

namespace cles::security {

/// The sessions for which HELLO has arrived here, and no DATA yet. Anybody can repeat a HELLO, so their number and age
/// are limited, and what HELLO stated does not count.
class half_open_sessions {
  public:
    static constexpr std::size_t most = 1024;
    static constexpr std::chrono::seconds longest{10};

    half_open_sessions(const fleet& of, entropy& random, std::uint32_t hellos_per_second)
        : fleet_(of), random_(random), rate_(hellos_per_second) {}

    /// What this node is in the session that a HELLO asks for.
    struct own_part {
        std::uint64_t index = 0; ///< new, and random
        std::uint64_t order = 0;
        node_statement stated{};
    };
    /// Opens a HELLO. The same one again has the same answer; a new one is opened only if there were few in this
    /// second. \param part called only if the HELLO is opened and new \return WELCOME, valid until the next call; null:
    /// no answer
    const hello_datagram* receive(const datagram_path& from, const datagram_head& head, bytes_view hello,
                                  const std::function<own_part()>& part, time_point now);

    [[nodiscard]] datagram_session* find(std::uint64_t index) noexcept;
    /// \pre `find` finds it
    [[nodiscard]] std::unique_ptr<datagram_session> take(std::uint64_t index);

    [[nodiscard]] std::size_t size() const noexcept { return entries_.size(); }
    [[nodiscard]] std::optional<time_point> next_deadline() const noexcept;
    void expire(time_point now);
    void forget(std::uint32_t member);
    void clear();

  private:
    struct entry {
        std::unique_ptr<datagram_session> session;
        std::uint64_t key = 0; // in `hellos_`
        hello_datagram hello{};
        hello_datagram welcome{};
    };
    using entries = std::map<std::uint64_t, entry>; // by order, so the oldest is the first

    [[nodiscard]] static std::uint64_t key_of(const datagram_path& from, bytes_view hello) noexcept;
    entries::iterator erase(entries::iterator at);

    const fleet& fleet_;
    entropy& random_;
    rate_limit rate_;
    entries entries_;
    boost::unordered_flat_map<std::uint64_t, std::uint64_t> hellos_;  // key of a HELLO -> order
    boost::unordered_flat_map<std::uint64_t, std::uint64_t> indices_; // own index -> order
};

} // namespace cles::security
