// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>

#include "node/base/deadlines.hpp"
#include "node/routing/local_request.hpp"
#include "node/routing/request_router.hpp"
#include "node/routing/subrequest.hpp"
#include "node/session/call.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The reply to a request for `all`: the outcome at each node, in the order of their names.
class aggregate_reply {
  public:
    void add_result(std::string_view node, std::string_view json);
    void add_failure(std::string_view node, const protocol::failure& why);
    /// Which update a node's result is. From the first call on, the reply contains the known marks.
    void add_mark(std::string_view node, const std::optional<update_mark>& mark);
    [[nodiscard]] std::string whole() const;

  private:
    static void begin_member(std::string& in, std::string_view node);

    std::string results_ = R"({"results":{)";
    std::string errors_;
    std::optional<std::string> marks_{};
};

/// When the reply is to be sent, so that it arrives before the deadline.
time_point answer_by(time_point due, time_point now);
/// Until when to wait for nodes whose tasks are not known yet: at most one second, and at most half of the remaining
/// time.
time_point stop_waiting_at(time_point due, time_point now);
/// The failure of a node that has not replied by then.
protocol::failure late(std::string_view node);

/// A request for `all`: sends it at once to all nodes that offer the task, and replies with their outcomes, at the
/// latest shortly before the deadline.
class scatter_gather final : public request_router::deferred_request,
                             public subrequest_events,
                             private deadline,
                             public std::enable_shared_from_this<scatter_gather> {
  public:
    scatter_gather(std::shared_ptr<request_router> by, const protocol::request_line& r, const identity& peer,
                   std::shared_ptr<call> answers, time_point due);

    /// Sends the requests. Returns false if it has to wait for more nodes to be discovered.
    bool begin(time_point now) override;
    [[nodiscard]] bool over() const override { return call_->ended(); }

  private:
    struct part {
        std::string node;
        std::uint64_t ticket = 0;
        std::unique_ptr<local_request> here{};
        std::optional<std::string> result{};
        std::optional<protocol::failure> failure{};

        [[nodiscard]] bool is_open() const noexcept { return !result && !failure; }
    };

    void on_result(std::size_t which, std::string_view json) override;
    void on_failure(std::size_t which, subrequest_failure why) override;
    void on_progress(std::size_t which, double fraction, std::string_view json) override;
    void on_deadline(time_point now) override;

    void ask_known(time_point now);
    void ask_all(time_point now);
    void follow();
    void finish();
    void cancel_open();

    std::shared_ptr<request_router> routing_;
    protocol::owned_request request_;
    const identity& peer_; // valid until the call has ended
    std::shared_ptr<call> call_;
    time_point due_;
    time_point answer_by_{};
    std::vector<part> parts_; // by name
    std::size_t open_ = 0;
    std::size_t bytes_ = 0; // of results
    bool begun_ = false;
    bool has_waited_ = false; // as long as permitted
    bool ended_ = false;
};

} // namespace cles::core
