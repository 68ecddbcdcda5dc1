// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/string_map.hpp"
#include "port/stranger_places.hpp"

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Watches one link for a peer that is of no use (docs/protocol.md, "Closing a link").
///
/// On a stream, this is one that never sends a line, or one that ended its stream and may have vanished since. A peer
/// that has ended its stream may still read, so its link is kept while it has bindings or outstanding replies. Nothing
/// more arrives on it, so only writing shows whether the peer still exists: an empty line, which every node ignores,
/// and which the host of a vanished peer answers with a reset.
///
/// A source of datagrams never closes its link: it is dropped when nothing has arrived from it for a while and no state
/// is kept for it (a running request, a reply that it may request again, a binding).
class link_monitor final : private deadline {
  public:
    static constexpr std::chrono::seconds max_pause{15};
    static constexpr std::chrono::seconds quiet{60}; ///< after which a source of datagrams is dropped

    class owner {
      public:
        owner() = default;
        owner(const owner&) = delete;
        owner& operator=(const owner&) = delete;
        /// Whether no state is kept for the peer, and nothing is expected from it.
        [[nodiscard]] virtual bool is_idle() const = 0;
        /// No complete line arrived in time, or no datagram for a while.
        virtual void on_silence() = 0;
        /// An empty line is due.
        virtual void on_probe() = 0;
        /// Other links need its place: ends the link and calls `link_admission::leave`.
        virtual void evict() = 0;

      protected:
        ~owner() = default;
    };

    link_monitor(owner& of, deadline_queue& deadlines, const limits& bounds, time_point now) noexcept
        : owner_(of), deadlines_(deadlines), bounds_(bounds), opened_(now), last_line_(now) {}

    /// The first line must arrive within `limits::first_line`.
    void expect_line();
    /// The link is a source of datagrams, the first of which has arrived.
    void expect_datagrams();
    /// A line has arrived, or a datagram, whatever its content.
    void on_line(time_point now) noexcept {
        last_line_ = now;
        if (!has_received_ && !is_source_) {
            deadlines_.disarm(*this);
            stranger_.release();
        }
        has_received_ = true;
    }
    /// The peer sends no more, but the link is kept.
    void on_end(time_point now);
    /// The link ends.
    void stop() noexcept { deadlines_.disarm(*this); }

    [[nodiscard]] bool has_received() const noexcept { return has_received_; }
    /// When the last line arrived, or the link was opened if none has.
    [[nodiscard]] time_point last_line() const noexcept { return last_line_; }
    [[nodiscard]] bool is_half_closed() const noexcept { return half_closed_at_.has_value(); }

  private:
    friend class link_admission;

    void on_deadline(time_point now) override;

    owner& owner_;
    deadline_queue& deadlines_;
    const limits& bounds_;
    time_point opened_;
    time_point last_line_;
    std::optional<time_point> half_closed_at_;
    bool has_received_ = false;
    bool is_source_ = false;
    std::string address_;                           // of `link_admission`
    std::size_t place_ = 0;                         // likewise
    stranger_places<link_monitor>::place stranger_; // likewise, until the first line
};

/// Decides which accepted links a node keeps when their number has reached the limit (docs/protocol.md, "Closing a
/// link").
///
/// Peers that do not use their links must not lock out new ones, and strangers with many addresses must not either. To
/// admit a new link, the node closes the first that exists of
///  1. of the address with the most links without a line, the oldest of these, if the new link's address has fewer;
///  2. the link that has been half-closed for longest;
///  3. the oldest without a line, whatever its address, if it has received none within `first_line_grace`;
///  4. if one address holds more than its share and the new link comes from another: of that address's links, the one
///     that has been idle for longest or, if none is idle, the newest;
///  5. the link that has been idle for longest, and for at least `idle_for`.
/// If there is none, the new link is refused.
class link_admission {
  public:
    static constexpr std::chrono::milliseconds first_line_grace{1'000};
    static constexpr std::chrono::seconds idle_for{60};
    /// After a search that found nothing, so that a flood of new links does not cost one each.
    static constexpr std::chrono::milliseconds search_pause{100};

    explicit link_admission(const limits& bounds) noexcept : bounds_(bounds) {}

    /// Whether there is capacity for a link from that address; evicts another link if necessary and possible.
    bool ensure_capacity(std::string_view address, time_point now);
    void enter(link_monitor& m, std::string_view address);
    /// \pre it has entered
    void leave(link_monitor& m);
    [[nodiscard]] std::size_t size() const noexcept { return links_.size(); }

  private:
    struct candidates {
        link_monitor* half_closed = nullptr;
        link_monitor* idle = nullptr;
    };
    candidates search(time_point now);
    [[nodiscard]] link_monitor* choose(std::string_view newcomer, time_point now);
    [[nodiscard]] link_monitor* link_of_largest_holder(std::string_view newcomer) const;

    const limits& bounds_;
    std::vector<link_monitor*> links_;
    string_map<std::size_t> per_address_;
    stranger_places<link_monitor> strangers_; // links without a line
    time_point search_again_{};
};

} // namespace cles::core
