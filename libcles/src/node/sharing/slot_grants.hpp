// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The slots that a node has granted to others: which jobs it accepts on them (docs/protocol.md, "Work sharing").
class slot_grants {
  public:
    static constexpr std::chrono::milliseconds valid_for{50};
    static constexpr unsigned max_slots = 1024; ///< of one grant

    /// Grants slots to a node, besides those that it has. \param number of a new grant, at random and not 0
    /// \return the number of the grant
    std::uint64_t open(std::string_view to, std::uint64_t number, unsigned slots, time_point now);
    /// Keeps workers free for so many of the slots, because the node will probably use them by then. Each reservation
    /// has its own end: renewing the grant does not prolong it.
    void reserve(std::string_view to, unsigned slots, time_point until, time_point now);
    /// So many of the reserved slots are not used now. They stay valid.
    void unreserve(std::string_view by, std::uint64_t number, unsigned slots);

    enum class verdict : std::uint8_t {
        valid,
        over,    ///< expired, or used up
        unknown, ///< not granted to that node
    };
    /// Checks the grant of a job, forwarded by that node.
    [[nodiscard]] verdict check(std::string_view by, std::uint64_t number, time_point now) const;
    /// A job has come on that grant, and will be accepted or refused: what was reserved for it is free again.
    void arrived(std::string_view by, std::uint64_t number, time_point now);
    /// Uses a slot of a valid grant.
    void use(std::string_view by);

    /// Slots that are reserved for jobs that have not come yet.
    [[nodiscard]] unsigned reserved(time_point now) const;
    /// When the next reservation ends; nothing if there is none.
    [[nodiscard]] std::optional<time_point> next_expiry(time_point now) const;
    /// The node is gone.
    void forget(std::string_view node);

  private:
    struct reservation {
        time_point until{};
        unsigned slots = 0;
    };
    struct grant {
        std::uint64_t number = 0;
        std::uint64_t previous = 0; // the one before, which has expired
        unsigned slots = 0;
        unsigned used = 0;
        time_point expires{};
        std::vector<reservation> reserved{}; // the oldest first

        void unreserve(unsigned count);
    };

    std::map<std::string, grant, std::less<>> grants_; // the last of each node
};

} // namespace cles::core
