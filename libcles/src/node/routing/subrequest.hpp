// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/pending.hpp>

#include "node/base/memory_budget.hpp"
#include "node/node_state.hpp"
#include "node/session/call.hpp"
#include "node/session/outbound.hpp"
#include "node/session/task_execution.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// Why a node gave no result to a request sent for a client.
struct subrequest_failure {
    protocol::failure reported;   ///< as reported to the client
    bool may_have_started = true; ///< its handler may have run
    bool unreachable = false;     ///< the request did not get there
};

/// Receives the outcome of a subrequest: a result, which is valid JSON, or why there is none. It is kept until it has
/// returned.
using subrequest_outcome = std::function<void(std::string_view json, subrequest_failure* why)>;

/// The part of a request for a client that another node serves: waits for its reply.
class subrequest : public detail::pending {
  public:
    explicit subrequest(subrequest_outcome then) noexcept : then_(std::move(then)) {}
    virtual ~subrequest() = default;

    verdict offer(std::string_view json) override;
    void fail(boost::system::error_code code, std::string_view message) override;
    void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) override;
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    void end(std::string_view json, subrequest_failure* why);

    subrequest_outcome then_;
};

/// The part of a request for a client that this node itself serves.
class local_request final : private task_sink {
  public:
    /// `memory` is the requester's account; null if memory is not counted.
    local_request(std::shared_ptr<node_state> host, subrequest_outcome then,
                  std::shared_ptr<memory_account> memory = nullptr, outbound::progress_function progress = {})
        : node_(std::move(host)), then_(std::move(then)), memory_(std::move(memory)), progress_(std::move(progress)) {}
    ~local_request();

    /// Runs the handler; its outcome may be reported inside the call.
    void run(const protocol::request_line& r, const identity& peer, time_point due, time_point now);
    /// Cancels the handler; nothing more is reported.
    void withdraw();

  private:
    void write_result(task_execution& task) override;
    void refuse(const task_execution& task, const protocol::failure& why) override;
    void keep(const task_execution& task, const std::shared_ptr<call>& c) override;
    void answer(const call& c, std::string_view json) override;
    void refuse(const call& c, const protocol::failure& why) override;
    bool report(const call& c, double fraction, std::string_view json) override;

    void finish(std::string json);
    void fail(protocol::failure why, bool begun);

    std::shared_ptr<node_state> node_;
    subrequest_outcome then_; // empty: it has ended
    std::shared_ptr<memory_account> memory_;
    outbound::progress_function progress_;
    std::shared_ptr<call> call_;
};

/// Reports progress to the client of `c`; empty if it does not want any.
outbound::progress_function progress_to(const std::shared_ptr<call>& c);

/// The failure, with a message that names the node.
protocol::failure named(subrequest_failure why, std::string_view node);

} // namespace cles::core
