// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "protocol/reply_line.hpp"

#include <cstddef>
#include <memory>
#include <string_view>

namespace cles::core {

/// Why one node that was asked for a client brought no result.
struct leg_failure {
    protocol::failure told;   ///< as the client may hear it
    bool begun = true;        ///< its handler may have run
    bool unreachable = false; ///< it was never asked
};

/// Who asks one node or several for a client.
class leg_events {
  public:
    leg_events() = default;
    leg_events(const leg_events&) = delete;
    leg_events& operator=(const leg_events&) = delete;
    virtual ~leg_events() = default;

    /// One of these, once, for each leg. The result is valid JSON.
    virtual void on_result(std::size_t leg, std::string_view json) = 0;
    virtual void on_failure(std::size_t leg, leg_failure why) = 0;
    /// Any number of times before.
    virtual void on_progress(std::size_t leg, double fraction, std::string_view json) = 0;
};

/// Waits for what another node answers.
class leg final : public detail::pending {
  public:
    leg(std::shared_ptr<leg_events> to, std::size_t which) noexcept : to_(std::move(to)), which_(which) {}

    verdict offer(std::string_view json) override;
    void fail(boost::system::error_code code, std::string_view message) override;
    void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) override;
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    void end(leg_failure why);

    std::shared_ptr<leg_events> to_;
    std::size_t which_;
};

} // namespace cles::core
