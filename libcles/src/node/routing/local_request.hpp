// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "node/base/memory_budget.hpp"
#include "node/node_state.hpp"
#include "node/routing/subrequest.hpp"
#include "node/session/call.hpp"
#include "node/session/task_execution.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// The part of a request for `any` or `all` that this node itself serves.
class local_request final : private task_sink {
  public:
    /// `memory` is the requester's account; null if memory is not counted.
    local_request(std::shared_ptr<node_state> host, std::shared_ptr<subrequest_events> to, std::size_t which,
                  std::shared_ptr<memory_account> memory = nullptr)
        : node_(std::move(host)), to_(std::move(to)), which_(which), memory_(std::move(memory)) {}
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

    void run_reserved(const protocol::request_line& r);
    void finish(std::string json);
    void fail(protocol::failure why, bool begun);

    std::shared_ptr<node_state> node_;
    std::shared_ptr<subrequest_events> to_; // null: it has ended
    std::size_t which_;
    std::shared_ptr<memory_account> memory_;
    std::shared_ptr<call> call_;
};

} // namespace cles::core
