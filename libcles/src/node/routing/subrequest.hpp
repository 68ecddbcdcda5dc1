// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "node/routing/next_hop.hpp"
#include "node/session/call.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace cles::core {

/// Why a node gave no result to a request sent for a client.
struct subrequest_failure {
    protocol::failure told;       ///< as reported to the client
    bool may_have_started = true; ///< its handler may have run
    bool unreachable = false;     ///< the request did not get there
};

/// Receives the outcomes of the subrequests that it has sent to one or several nodes for a client.
class subrequest_events {
  public:
    subrequest_events() = default;
    subrequest_events(const subrequest_events&) = delete;
    subrequest_events& operator=(const subrequest_events&) = delete;
    virtual ~subrequest_events() = default;

    /// One of these, once, for each subrequest. The result is valid JSON.
    virtual void on_result(std::size_t which, std::string_view json) = 0;
    virtual void on_failure(std::size_t which, subrequest_failure why) = 0;
    /// Any number of times before the outcome.
    virtual void on_progress(std::size_t which, double fraction, std::string_view json) = 0;
};

/// Waits for the reply of another node.
class subrequest final : public detail::pending {
  public:
    subrequest(std::shared_ptr<subrequest_events> to, std::size_t which) noexcept : to_(std::move(to)), which_(which) {}

    verdict offer(std::string_view json) override;
    void fail(boost::system::error_code code, std::string_view message) override;
    void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) override;
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    void end(subrequest_failure why);

    std::shared_ptr<subrequest_events> to_;
    std::size_t which_;
};

/// Forwards a request to the node that it names. Reply, progress and cancellation are forwarded too.
class forwarding final : public subrequest_events, public std::enable_shared_from_this<forwarding> {
  public:
    forwarding(std::shared_ptr<call> answers, std::string node) : call_(std::move(answers)), node_(std::move(node)) {}

    void go(next_hop& out, const protocol::request_line& r, std::string_view own_name, time_point due);

  private:
    void on_result(std::size_t which, std::string_view json) override;
    void on_failure(std::size_t which, subrequest_failure why) override;
    void on_progress(std::size_t which, double fraction, std::string_view json) override;

    std::shared_ptr<call> call_;
    std::string node_;
};

/// Sends `r` to `node`. The outcome is reported to `events`, as that of subrequest `which`. Returns a ticket
/// for `next_hop::cancel`.
std::uint64_t send_subrequest(next_hop& out, const protocol::request_line& r, std::string_view node,
                              std::string_view adverbs, time_point due, std::shared_ptr<subrequest_events> events,
                              std::size_t which);

/// The failure, with a message that names the node.
protocol::failure named(subrequest_failure why, std::string_view node);

} // namespace cles::core
