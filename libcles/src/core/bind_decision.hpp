// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/leg.hpp"
#include "core/local_request.hpp"
#include "core/node.hpp"
#include "protocol/request_line.hpp"

#include <functional>
#include <memory>

namespace cles::core {

/// Has a handler for BIND that takes its time say whether a binding is welcome.
class bind_decision final : public leg_events, public std::enable_shared_from_this<bind_decision> {
  public:
    /// Null: it is welcome.
    using outcome = std::function<void(const protocol::failure* why_not)>;

    /// Whether the handler for this noun is one that takes its time.
    static bool is_needed(const node& host, const protocol::request_line& request);

    /// \param told is called once, maybe inside `ask`, unless it is withdrawn
    bind_decision(std::shared_ptr<node> host, outcome told) : node_(std::move(host)), told_(std::move(told)) {}

    /// `peer` lives until it is told or withdrawn.
    void ask(const protocol::request_line& request, const identity& peer, time_point due, time_point now);
    /// Nothing is told any more, and the handler is told to stop.
    void withdraw();

  private:
    void on_result(std::size_t leg, std::string_view json) override;
    void on_failure(std::size_t leg, leg_failure why) override;
    void on_progress(std::size_t, double, std::string_view) override {}
    void tell(const protocol::failure* why_not);

    std::shared_ptr<node> node_;
    outcome told_;
    std::unique_ptr<local_request> asked_;
};

} // namespace cles::core
