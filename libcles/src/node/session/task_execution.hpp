// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/request.hpp>
#include <cles/task_info.hpp>

#include "node/base/memory_budget.hpp"
#include "port/request_origin.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <boost/container/static_vector.hpp>

#include <array>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class call;
struct node_state;
class task_execution;

/// A handler as the core runs it. At most one of the two functions is set.
struct handler {
    bool present = false;
    task_info info{};
    std::function<void(const request&, json_writer&)> plain{};
    std::function<void(const request&, const std::shared_ptr<call>&)> start{};
};

/// The tasks that a node offers.
class task_registry {
  public:
    /// \throws cles::error: `invalid_name`, `already_registered`, and `too_large` if the names of signed tasks exceed
    /// `max_signed_names`
    [[gnu::cold]] void add(cles::verb verb, std::string_view task, handler entry);

    /// Removes a handler and returns it, because it may be running; null if there is none. Nouns of a signed task are
    /// signed even then.
    [[gnu::cold]] std::unique_ptr<handler> remove(cles::verb verb, std::string_view task);

    /// The handler, or null.
    [[nodiscard]] const handler* find(cles::verb verb, std::string_view task) const noexcept;
    /// Whether a BIND of the task is served: BIND or UPDATE is registered for it.
    [[nodiscard]] bool can_bind(std::string_view task) const noexcept;

    /// The total size of the names of signed tasks, which announcements list.
    static constexpr std::size_t max_signed_names = 512;
    /// Tasks of which at least one verb must be signed, in order of registration.
    [[nodiscard]] const std::vector<std::string>& signed_tasks() const noexcept { return signed_; }
    [[nodiscard]] bool is_signed(std::string_view task) const noexcept;

    using handlers = std::array<handler, verb_count>;
    /// All tasks, sorted by name.
    [[nodiscard]] const std::map<std::string, handlers, std::less<>>& tasks() const noexcept { return tasks_; }

  private:
    [[gnu::cold]] void add_signed(std::string_view task);

    std::map<std::string, handlers, std::less<>> tasks_;
    std::vector<std::string> signed_;
};

/// \throws cles::error with `invalid_name` if the name of a task or the like is not valid
[[gnu::cold]] void check_name(std::string_view name, std::string_view of);

/// Receives the outcome of a request that a task of this node serves: from its `task_execution` if the handler replies
/// at once, else from its `call`. Usually serves the link on which the request arrived. The call has ended by then, so
/// the sink only has to release it.
class task_sink {
  public:
    task_sink() = default;
    task_sink(const task_sink&) = delete;
    task_sink& operator=(const task_sink&) = delete;

    /// Has the result written by `task.write`, and replies with it. An exception from there passes through, and nothing
    /// has been replied then.
    virtual void write_result(task_execution& task) = 0;
    /// The handler was not called, or failed.
    virtual void refuse(const task_execution& task, const protocol::failure& why) = 0;
    /// The handler is about to be called and replies later. Keeps the call until its outcome.
    virtual void keep(const task_execution& task, const std::shared_ptr<call>& c) = 0;

    virtual void answer(const call& c, std::string_view json) = 0;
    virtual void refuse(const call& c, const protocol::failure& why) = 0;
    /// `fraction` never decreases. Returns false if nobody waits for progress.
    virtual bool report(const call& c, double fraction, std::string_view json) = 0;
    /// Whether the node has memory for a reply of this size.
    [[nodiscard]] virtual bool can_answer(std::size_t /*bytes*/) { return true; }
    /// The requester's URL; empty if it is this node itself.
    [[nodiscard]] virtual std::string_view peer_address() const noexcept { return {}; }

  protected:
    ~task_sink() = default;
};

using decoded_parameters = boost::container::static_vector<std::string_view, protocol::max_parameters>;

/// The decoded parameters: those with escapes are stored in `storage`, the others are views of the line.
decoded_parameters decode(const protocol::noun_view& noun, std::string& storage);

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
    [[nodiscard]] std::optional<protocol::failure> capacity_refusal(const memory_account* memory);
    [[nodiscard, gnu::cold]] std::optional<protocol::failure> grant_refusal();
    [[nodiscard, gnu::cold]] std::optional<protocol::failure> signature_refusal();
    void start(task_sink& to, const std::shared_ptr<memory_account>& memory);
    [[nodiscard]] std::string_view publish_path() { return protocol::canonical_path(line_.noun, path_); }

    const std::shared_ptr<node_state>& node_;
    const protocol::request_line& line_;
    time_point due_;
    const time_point now_;
    const handler* handler_; // null: not found
    decoded_parameters parameters_;
    const std::string trace_; // empty: none
    const request_origin origin_;
    detail::request_data data_;
    const request request_;
    std::string path_;
    bool started_ = false;
    bool granted_ = false; // it has used a slot of a grant of this node
};

} // namespace cles::core
