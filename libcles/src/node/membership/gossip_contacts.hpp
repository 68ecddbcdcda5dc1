// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// A node that is asked for its table.
struct gossip_contact {
    enum class part : std::uint8_t {
        successor, ///< next by name
        chosen,    ///< at random
        bootstrap, ///< until it has sent its whole table
    };
    part as = part::bootstrap;
    std::string node; ///< empty: not known yet
    std::string url;
    std::string since = "0";
    std::uint64_t ticket = 0; ///< 0: no request is in progress
    time_point sent{};
    time_point next = time_point::min();
    time_point until = time_point::max();
    std::string describe{};      ///< epochs to describe, separated by commas
    std::size_t table_bytes = 0; ///< size of a table that is always sent whole
    std::size_t among = 0;       ///< number of known nodes when it was chosen
    unsigned failures = 0;       ///< in a row
    bool own_entry_sent = false;
    bool ended = false;
};

/// The nodes that are asked, and those that failed recently.
class gossip_contacts {
  public:
    using contact = gossip_contact;
    using part = gossip_contact::part;

    contact& add(part as, std::string_view node, std::string_view url, time_point now);
    [[nodiscard]] contact* find_ticket(std::uint64_t ticket) noexcept;
    [[nodiscard]] contact* find_node(std::string_view node) noexcept;
    [[nodiscard]] contact* find(part as) noexcept;
    [[nodiscard]] std::size_t count(part as) const noexcept;

    /// Excludes `node` from selection until then.
    void rest(std::string_view node, time_point until);
    [[nodiscard]] bool rests(std::string_view node, time_point now) const noexcept;
    void expire_resting(time_point now);

    /// Removes the contacts that have ended; \returns the URLs at which no other contact is asked.
    std::vector<std::string> take_ended();
    void clear() noexcept { all_.clear(); }

    [[nodiscard]] auto begin() noexcept { return all_.begin(); }
    [[nodiscard]] auto end() noexcept { return all_.end(); }
    [[nodiscard]] auto begin() const noexcept { return all_.begin(); }
    [[nodiscard]] auto end() const noexcept { return all_.end(); }

  private:
    struct resting {
        std::string node;
        time_point until{};
    };

    std::vector<contact> all_;
    std::vector<resting> resting_;
};

} // namespace cles::core
