// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "core/deadlines.hpp"

#include <chrono>
#include <cstdint>

namespace cles::shell {

class local_node;

/// The end of a service in order, so that no request is lost (docs/protocol.md, "Leaving"): it begins nothing more,
/// answers what it has begun, says on each link that it leaves, and waits until the links have ended.
class departure final : private core::deadline {
  public:
    /// What has not been answered after `limit` is cut short. `done` ends when the links have, soon after that at the
    /// latest, or fails in `give_up`.
    departure(local_node& host, std::uint64_t ticket, std::chrono::milliseconds limit, detail::pending_ptr done);
    ~departure() = default;

    /// To be called whenever something has happened.
    void look();
    /// Of the operation, while it waits; else 0.
    [[nodiscard]] std::uint64_t ticket() const noexcept { return done_ ? ticket_ : 0; }
    /// Gives the operation back, which has ended if it is null; nothing happens any more.
    [[nodiscard]] detail::pending_ptr give_up();

  private:
    void on_deadline(time_point now) override;
    [[nodiscard]] bool something_runs() const;
    void end_links();
    void end();

    local_node& host_;
    std::uint64_t ticket_;
    detail::pending_ptr done_;
    bool looking_ = false;
    bool ending_ = false; // all that was begun has been answered
};

} // namespace cles::shell
