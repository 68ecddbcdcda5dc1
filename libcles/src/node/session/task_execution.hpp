// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/json_writer.hpp>
#include <cles/request.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/memory_budget.hpp"
#include "node/node_state.hpp"
#include "node/session/call.hpp"
#include "node/session/request_checks.hpp"
#include "node/session/task_registry.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

class task_execution;

/// Receives the outcome of a request that a task of this node serves: by one of these functions if the handler replies
/// at once, else as the owner of its call.
class task_sink : public call_owner {
  public:
    using call_owner::refuse;
    /// Has the result written by `task.write`, and replies with it. An exception from there passes through, and nothing
    /// has been replied then.
    virtual void write_result(task_execution& task) = 0;
    /// The handler was not called, or failed.
    virtual void refuse(const task_execution& task, const protocol::failure& why) = 0;
    /// The handler is about to be called and replies later. Keeps the call until its outcome.
    virtual void keep(const task_execution& task, const std::shared_ptr<call>& c) = 0;

  protected:
    ~task_sink() = default;
};

/// Runs a task of this node for one request: of a link, or of this node itself as a part of `any` or `all`. Decides
/// whether it may run and what it publishes; the sink delivers the result.
class task_execution {
  public:
    /// `line` has been checked. All of these, and `decoded` (scratch space for parameters), must outlive this.
    task_execution(const std::shared_ptr<node_state>& host, const protocol::request_line& line, const identity& peer,
                   time_point due, time_point now, std::string& decoded);
    task_execution(const task_execution&) = delete;
    task_execution& operator=(const task_execution&) = delete;
    ~task_execution() = default;

    /// Reports the outcome to `to`: now, or later by a call. `memory` is the requester's account; null if memory is not
    /// counted.
    void run(task_sink& to, const std::shared_ptr<memory_account>& memory);

    // For the sink.
    /// Runs the handler, which writes its result. The handler's exceptions pass through.
    void write(json_writer& w);
    /// Whether the handler has been called.
    [[nodiscard]] bool started() const noexcept { return started_; }
    [[nodiscard]] const protocol::request_line& line() const noexcept { return line_; }
    [[nodiscard]] time_point due() const noexcept { return due_; }
    [[nodiscard]] time_point now() const noexcept { return now_; }

  private:
    [[nodiscard]] std::optional<protocol::failure> refusal(const memory_account* memory);
    void run_plain(task_sink& to);
    void start(task_sink& to, const std::shared_ptr<memory_account>& memory);
    [[nodiscard]] call::terms terms();
    [[nodiscard]] std::string_view publish_path() { return protocol::canonical_path(line_.noun, path_); }

    const std::shared_ptr<node_state>& node_;
    const protocol::request_line& line_;
    const time_point due_;
    const time_point now_;
    const handler* handler_; // null: not found
    decoded_parameters parameters_;
    const detail::request_data data_;
    const request request_;
    std::string path_;
    bool started_ = false;
};

} // namespace cles::core
