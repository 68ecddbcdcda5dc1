// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Somebody who is asked for his table.
struct gossip_contact {
    enum class part : std::uint8_t {
        successor, ///< the next one by name
        chosen,    ///< by chance
        guest,     ///< until he has told all that he knows
    };
    part as = part::guest;
    std::string node; ///< empty: nobody knows yet
    std::string url;
    std::string since = "0";
    std::uint64_t ticket = 0; ///< 0: nothing is under way
    time_point sent{};
    time_point next = time_point::min();
    time_point until = time_point::max();
    std::string describe{};      ///< epochs of which to ask for more, separated by commas
    std::size_t table_bytes = 0; ///< of a table that comes whole each time
    std::size_t among = 0;       ///< how many were known when chance chose it
    unsigned failures = 0;       ///< in a row
    bool told = false;           ///< of this node
    bool ended = false;
};

/// All who are asked, and who was given up lately.
class gossip_contacts {
  public:
    using contact = gossip_contact;
    using part = gossip_contact::part;

    contact& add(part as, std::string_view node, std::string_view url, time_point now);
    [[nodiscard]] contact* find_ticket(std::uint64_t ticket) noexcept;
    [[nodiscard]] contact* find_node(std::string_view node) noexcept;
    [[nodiscard]] contact* find(part as) noexcept;
    [[nodiscard]] std::size_t count(part as) const noexcept;

    /// It is not chosen again until then.
    void rest(std::string_view node, time_point until);
    [[nodiscard]] bool rests(std::string_view node, time_point now) const noexcept;
    void wake(time_point now);

    /// Lets go of those that have ended; \returns where they were asked and nobody is now.
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
