// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/deadlines.hpp"
#include "node/session/peer_description.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

namespace cles::core {

/// What has moved on a link.
struct link_traffic {
    std::uint64_t received = 0; ///< bytes
    std::uint64_t sent = 0;     ///< bytes that the transport has accepted
    std::size_t unsent = 0;     ///< bytes that it has not accepted yet
    bool reads = true;          ///< this node reads the link
};

/// What this node knows of the node at the other end of a link that it has opened: how that describes itself, and
/// whether it still lives (docs/protocol.md, "The node at the other end").
///
/// A process that hangs keeps its links: its host goes on acknowledging what arrives. So who waits for the peer asks
/// one that is silent, with `PULL self:cles`, and takes it for lost if it stays silent. Only nodes are asked. A person
/// with netcat, who is silent for as long as it takes, is not.
class link_peer final : private deadline {
  public:
    class owner {
      public:
        owner() = default;
        owner(const owner&) = delete;
        owner& operator=(const owner&) = delete;
        /// Whether the peer is known to be a node without having answered here: others announce it, or it has
        /// authenticated itself.
        [[nodiscard]] virtual bool is_node() const = 0;
        /// Whether something is bound there, or a reply is awaited besides those to `ask_peer`.
        [[nodiscard]] virtual bool awaits_peer() const = 0;
        [[nodiscard]] virtual link_traffic traffic() const = 0;
        /// Sends `PULL self:cles`; `on_described` or `on_undescribed` follows, unless the link is lost.
        virtual void ask_peer() = 0;
        /// The peer has been silent for the limit, and has not answered.
        virtual void on_hung() = 0;

      protected:
        ~owner() = default;
    };

    /// `limit`: how long a peer may be silent that is waited for; 0: for ever
    link_peer(owner& of, deadline_queue& deadlines, std::chrono::milliseconds limit) noexcept
        : owner_(of), deadlines_(deadlines), limit_(limit) {}

    // -- its description
    /// Asks for it, the first time.
    void learn();
    void on_described(peer_description found);
    /// It cannot be had: the peer refuses to answer, or does not in time.
    void on_undescribed() noexcept;
    /// The peer has been replaced by another incarnation.
    void forget() noexcept;
    /// Whether it has been asked for, and neither it nor a refusal has been received.
    [[nodiscard]] bool is_learning() const noexcept { return state_ == state::asked; }
    /// Whether there is nothing to wait for: it is here, or cannot be had.
    [[nodiscard]] bool has_answered() const noexcept { return state_ == state::described || state_ == state::unknown; }
    /// Empty until it is here.
    [[nodiscard]] const peer_description& description() const noexcept { return description_; }

    // -- its life
    /// Something may be waited for from now on. Cheap if that is known.
    void watch(time_point now) {
        if (!armed() && limit_.count() > 0) {
            begin(now);
        }
    }
    [[nodiscard]] bool is_watched() const noexcept { return armed() || limit_.count() <= 0; }
    /// A line has arrived, whatever it is.
    void on_line(time_point now) noexcept { heard_ = now; }
    /// The link ends.
    void stop() noexcept { deadlines_.disarm(*this); }

  private:
    enum class state : std::uint8_t { unasked, asked, described, unknown };
    struct question {
        time_point sent;
        time_point lost; ///< then the peer counts as lost if it has not answered
        link_traffic traffic;
    };

    void on_deadline(time_point now) override;
    void begin(time_point now);
    [[nodiscard]] std::chrono::milliseconds pause() const noexcept;
    [[nodiscard]] bool has_moved_since(const link_traffic& then) const;

    owner& owner_;
    deadline_queue& deadlines_;
    std::chrono::milliseconds limit_;
    state state_ = state::unasked;
    peer_description description_;
    time_point heard_{};
    time_point begun_{};           // silence counts from here
    std::optional<question> open_; // without an answer, or any other line since
};

} // namespace cles::core
