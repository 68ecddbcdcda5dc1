// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/link_monitor.hpp"
#include "core/text_map.hpp"

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Which links that others opened a node keeps, when there are as many as there may be (docs/protocol.md, "Closing a
/// link").
///
/// Peers that hold a link for nothing must not lock newcomers out. To make room for one, the node closes the first that
/// there is of
///  1. the link that has been half-closed for longest;
///  2. the oldest of those that have not sent a line, but had time for one;
///  3. where one address holds more than its share and the newcomer comes from another: the link of that address that
///     has been idle for longest, or, where all are in use, the one that was opened last;
///  4. the link that has been idle for longest, and for long enough.
/// Where there is none of them, the newcomer is refused.
class link_admission {
  public:
    static constexpr std::chrono::milliseconds time_to_speak{1'000};
    static constexpr std::chrono::seconds idle_for{60};
    /// After a search that found nothing, so that a flood of newcomers does not cost one each.
    static constexpr std::chrono::milliseconds search_pause{100};

    /// A link that has been admitted.
    class guest {
      public:
        guest() = default;
        guest(const guest&) = delete;
        guest& operator=(const guest&) = delete;
        [[nodiscard]] virtual const link_monitor& monitor() const = 0;
        /// Nothing is kept for the peer, and nothing is expected of it.
        [[nodiscard]] virtual bool at_rest() const = 0;
        /// Ends the link, and leaves.
        virtual void give_way() = 0;

      protected:
        ~guest() = default;

      private:
        friend class link_admission;
        std::string address_;
        std::size_t place_ = 0;
    };

    explicit link_admission(const limits& bounds) noexcept : bounds_(bounds) {}

    /// Whether there is room for a link from that address; makes some where it can.
    bool make_room(std::string_view address, time_point now);
    void enter(guest& g, std::string_view address);
    /// \pre it has entered
    void leave(guest& g);
    [[nodiscard]] std::size_t size() const noexcept { return guests_.size(); }

  private:
    struct candidates {
        guest* first = nullptr; ///< half-closed, or silent
        guest* idle = nullptr;
    };
    [[nodiscard]] std::size_t share() const noexcept;
    candidates search(time_point now);
    [[nodiscard]] guest* of_the_greediest(std::string_view newcomer) const;

    const limits& bounds_;
    std::vector<guest*> guests_;
    text_map<std::size_t> per_address_;
    time_point search_again_{};
};

} // namespace cles::core
