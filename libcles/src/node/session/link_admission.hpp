// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/string_map.hpp"
#include "node/session/link_monitor.hpp"

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Decides which accepted links a node keeps when their number has reached the limit (docs/protocol.md, "Closing a
/// link").
///
/// Peers that do not use their links must not lock out new ones. To make room for a new link, the node closes the first
/// that exists of
///  1. the link that has been half-closed for longest;
///  2. the oldest link that has received no line within `first_line_grace`;
///  3. if one address holds more than its share and the new link comes from another: of that address's links, the one
///     that has been idle for longest or, if none is idle, the newest;
///  4. the link that has been idle for longest, and for at least `idle_for`.
/// If there is none, the new link is refused.
class link_admission {
  public:
    static constexpr std::chrono::milliseconds first_line_grace{1'000};
    static constexpr std::chrono::seconds idle_for{60};
    /// After a search that found nothing, so that a flood of new links does not cost one each.
    static constexpr std::chrono::milliseconds search_pause{100};

    class admitted_link {
      public:
        admitted_link() = default;
        admitted_link(const admitted_link&) = delete;
        admitted_link& operator=(const admitted_link&) = delete;
        [[nodiscard]] virtual const link_monitor& monitor() const = 0;
        /// Whether no state is kept for the peer, and nothing is expected from it.
        [[nodiscard]] virtual bool is_idle() const = 0;
        /// Ends the link and calls `leave`.
        virtual void evict() = 0;

      protected:
        ~admitted_link() = default;

      private:
        friend class link_admission;
        std::string address_;
        std::size_t place_ = 0;
    };

    explicit link_admission(const limits& bounds) noexcept : bounds_(bounds) {}

    /// Whether there is room for a link from that address; evicts another link if necessary and possible.
    bool make_room(std::string_view address, time_point now);
    void enter(admitted_link& g, std::string_view address);
    /// \pre it has entered
    void leave(admitted_link& g);
    [[nodiscard]] std::size_t size() const noexcept { return links_.size(); }

  private:
    struct candidates {
        admitted_link* first = nullptr; ///< half-closed, or without a line
        admitted_link* idle = nullptr;
    };
    [[nodiscard]] std::size_t share() const noexcept;
    candidates search(time_point now);
    [[nodiscard]] admitted_link* link_of_largest_holder(std::string_view newcomer) const;

    const limits& bounds_;
    std::vector<admitted_link*> links_;
    string_map<std::size_t> per_address_;
    time_point search_again_{};
};

} // namespace cles::core
