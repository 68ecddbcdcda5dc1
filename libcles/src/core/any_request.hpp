// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "core/call.hpp"
#include "core/held_request.hpp"
#include "core/leg.hpp"
#include "core/local_request.hpp"
#include "core/routing.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cles::core {

/// A request for `any`: asks one node, and another where that one could not be reached or refused the work before it
/// began. Work that began and was lost is repeated only where that does no harm, and once: what brings down the node
/// that does it is not to go from node to node.
class any_request final : public routing::errand, public leg_events, public std::enable_shared_from_this<any_request> {
  public:
    /// Of busy nodes no more are asked than this: a network that is full is not to be kept at it by asking around.
    static constexpr int most_busy = 3;

    any_request(std::shared_ptr<routing> by, const protocol::request_line& r, const identity& peer,
                std::shared_ptr<call> answers, time_point due);

    /// Asks whom `chosen` says.
    void ask(const chooser::chosen& chosen, time_point now);
    /// Goes on after this node, which has refused it before it began.
    void go_on_from_here(const protocol::failure& why);
    /// Chooses one, or another. False where it has to wait for others to be heard of.
    bool begin(time_point now) override;
    [[nodiscard]] bool over() const override { return call_->ended(); }

  private:
    void on_result(std::size_t leg, std::string_view json) override;
    void on_failure(std::size_t leg, leg_failure why) override;
    void on_progress(std::size_t leg, double fraction, std::string_view json) override;

    void go_on(leg_failure why);
    void ask_another(time_point now);
    void give_up(protocol::failure why, bool begun);
    [[nodiscard]] bool may_repeat(const leg_failure& why) const noexcept;
    void follow_stop();
    void stop();
    void note_end(const leg_failure* why, time_point now);

    std::shared_ptr<routing> routing_;
    held_request request_;
    const identity& peer_; // lives as long as the call has not ended
    std::shared_ptr<call> call_;
    time_point due_;
    std::vector<std::string> asked_; // the last one is asked now
    bool idempotent_ = false;        // where it is asked
    bool known_ = false;             // it is another, whose load is followed
    int busy_ = 0;
    std::optional<protocol::failure> last_busy_;
    std::optional<protocol::failure> lost_; // a node that may have begun it
    std::optional<leg_failure> going_on_;   // after this, to another one
    std::uint64_t ticket_ = 0;
    std::unique_ptr<local_request> here_;
};

} // namespace cles::core
