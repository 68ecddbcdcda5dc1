// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "node/base/deadlines.hpp"

#include <chrono>
#include <cstdint>

namespace cles::core {

class local_node;

/// Shuts a service down in order, so that no request is lost (docs/protocol.md, "Leaving"): it starts nothing new,
/// answers what it has started, announces on each link that it leaves, and waits until the links have ended.
class graceful_shutdown final : private core::deadline {
  public:
    /// Requests that have not been answered after `limit` are aborted. `done` completes when the links have ended, or
    /// `limits::discard` after their end began, unless `give_up` returns it first.
    graceful_shutdown(local_node& host, std::uint64_t ticket, std::chrono::milliseconds limit,
                      detail::pending_ptr done);
    ~graceful_shutdown() = default;

    /// Call after every event.
    void check();
    /// The operation's ticket while it waits, else 0.
    [[nodiscard]] std::uint64_t ticket() const noexcept { return done_ ? ticket_ : 0; }
    /// Stops and returns the operation; null if it has completed.
    [[nodiscard]] detail::pending_ptr give_up();

  private:
    void on_deadline(time_point now) override;
    [[nodiscard]] bool has_running_requests() const;
    void end_links();
    void end();

    local_node& host_;
    std::uint64_t ticket_;
    detail::pending_ptr done_;
    bool looking_ = false;
    bool ending_ = false; // everything that was started has been answered
};

} // namespace cles::core
