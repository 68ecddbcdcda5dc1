// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/json_writer.hpp>
#include <cles/request.hpp>

#include "core/call.hpp"
#include "core/memory_budget.hpp"
#include "core/node.hpp"
#include "core/registry.hpp"
#include "core/request_checks.hpp"
#include "protocol/message.hpp"

#include <memory>
#include <optional>
#include <string>

namespace cles::core {

/// A request whose task this node runs, of a link or of this node itself as one of those that `any` and `all`
/// mean. Here it is decided whether it may run, and what it publishes; where the result goes is the asker's to say.
class execution {
  public:
    /// The request, which has been checked, and `peer` outlive this; `decoded` is room for parameters.
    execution(node& host, const protocol::request_line& r, const identity& peer, time_point due, std::string& decoded);
    execution(const execution&) = delete;
    execution& operator=(const execution&) = delete;
    ~execution() = default;

    /// Why it is not begun; nothing where it may be. `held` is what counts the memory of the asker; null: nobody, or
    /// what it is part of holds memory already.
    [[nodiscard]] std::optional<protocol::failure> refusal(const memory_account* held = nullptr);
    /// Without a refusal: whether its handler answers at once, by `run`, or later, by `start`.
    [[nodiscard]] bool is_plain() const noexcept { return static_cast<bool>(handler_->plain); }
    /// Runs the handler, which writes its result. What it throws passes through.
    void run(json_writer& w);
    /// What a call for it is to know.
    [[nodiscard]] call::terms terms();
    /// Starts the handler, which answers by the call.
    void start(const std::shared_ptr<call>& c);

  private:
    [[nodiscard]] std::string_view publish_path() { return protocol::canonical_path(line_.noun, path_); }

    node& node_;
    const protocol::request_line& line_;
    const handler* handler_; // null: there is none
    decoded_parameters parameters_;
    const detail::request_data data_;
    const request request_;
    std::string path_;
};

/// The call of an execution has its result: publishes what was to be, where it was a request to publish. Throws what
/// publishing throws.
void publish_for(node& host, const call::terms& wanted);

/// What a handler's failure says to the requester; `busy` promises that the work has not begun.
[[nodiscard]] bool has_begun(const protocol::failure& why) noexcept;

} // namespace cles::core
