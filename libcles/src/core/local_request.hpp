// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/call.hpp"
#include "core/leg.hpp"
#include "core/node.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <memory>
#include <string>

namespace cles::core {

class execution;

/// A request for `any` or `all` that this node serves itself, as one of those that might or do.
class local_request final : public call_owner {
  public:
    local_request(std::shared_ptr<node> host, std::shared_ptr<leg_events> to, std::size_t which)
        : node_(std::move(host)), to_(std::move(to)), which_(which) {}
    ~local_request();

    /// Runs the handler; what comes of it may be told inside the call.
    void run(const protocol::request_line& r, const identity& peer, time_point due, time_point now);
    /// Nothing more is told.
    void withdraw();

  private:
    void answer(call& c, std::string_view json) override;
    void refuse(call& c, const protocol::failure& why) override;
    void report(call& c, double fraction, std::string_view json) override;

    void run_reserved(const protocol::request_line& r);
    void run_plain(execution& task);
    void run_later(execution& task, time_point due, time_point now);
    std::shared_ptr<call> let_go(call& c);
    void finish(std::string json);
    void fail(protocol::failure why, bool begun);

    std::shared_ptr<node> node_;
    std::shared_ptr<leg_events> to_; // null: it has ended
    std::size_t which_;
    std::shared_ptr<call> call_;
};

} // namespace cles::core
