// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/call.hpp"
#include "core/leg.hpp"
#include "core/onward.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <memory>
#include <string>

namespace cles::core {

/// A request that is passed on to the node that it names: what is answered, how far it is and whether it is still
/// wanted is passed on too.
class forwarding final : public leg_events, public std::enable_shared_from_this<forwarding> {
  public:
    forwarding(std::shared_ptr<call> answers, std::string node) : call_(std::move(answers)), node_(std::move(node)) {}

    void go(onward& out, const protocol::request_line& r, std::string_view own_name, time_point due);

  private:
    void on_result(std::size_t leg, std::string_view json) override;
    void on_failure(std::size_t leg, leg_failure why) override;
    void on_progress(std::size_t leg, double fraction, std::string_view json) override;

    std::shared_ptr<call> call_;
    std::string node_;
};

/// Asks the node for the client of `c`, on behalf of `errand`, as its leg of that number. Returns what it is withdrawn
/// by.
std::uint64_t send_onward(onward& out, const protocol::request_line& r, std::string_view node, std::string_view adverbs,
                          time_point due, std::shared_ptr<leg_events> errand, std::size_t which);

/// A failure on the way to a node, in words that name it.
protocol::failure named(leg_failure why, std::string_view node);

} // namespace cles::core
