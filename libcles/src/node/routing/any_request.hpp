// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "node/routing/local_request.hpp"
#include "node/routing/request_router.hpp"
#include "node/routing/subrequest.hpp"
#include "node/session/call.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cles::core {

/// A request for `any`: sends it to one node, and to another if that one cannot be reached or refuses the work before
/// it starts. Work that has started and is lost is repeated only if that does no harm, and only once, so that a request
/// that crashes its node does not go from node to node.
class any_request final : public request_router::deferred_request,
                          public subrequest_events,
                          public std::enable_shared_from_this<any_request> {
  public:
    /// The maximum number of busy nodes that are asked, so that repeats do not load a full network further.
    static constexpr int max_busy = 3;

    any_request(std::shared_ptr<request_router> by, const protocol::request_line& r, const identity& peer,
                std::shared_ptr<call> answers, time_point due);

    /// Sends the request to `chosen`.
    void ask(const load_balancer::chosen& chosen, time_point now);
    /// Continues after this node has refused the request before starting it.
    void continue_after_local_refusal(const protocol::failure& why);
    /// Selects a node, or another one. Returns false if it has to wait for more nodes to be discovered.
    bool begin(time_point now) override;
    [[nodiscard]] bool over() const override { return call_->ended(); }

  private:
    void on_result(std::size_t which, std::string_view json) override;
    void on_failure(std::size_t which, subrequest_failure why) override;
    void on_progress(std::size_t which, double fraction, std::string_view json) override;

    void try_next(subrequest_failure why);
    void ask_another(time_point now);
    void give_up(protocol::failure why, bool may_have_started);
    [[nodiscard]] bool may_repeat(const subrequest_failure& why) const noexcept;
    void follow_stop();
    void stop();
    void note_end(const subrequest_failure* why, time_point now);

    std::shared_ptr<request_router> routing_;
    protocol::owned_request request_;
    const identity& peer_; // valid until the call has ended
    std::shared_ptr<call> call_;
    time_point due_;
    std::vector<std::string> asked_; // the last one is asked now
    bool idempotent_ = false;        // at the node asked now
    bool known_ = false;             // that node is another one, whose load is tracked
    int busy_ = 0;
    std::optional<protocol::failure> last_busy_;
    std::optional<protocol::failure> lost_;         // from a node that may have started it
    std::optional<subrequest_failure> retry_after_; // after this failure, to be sent to another node
    std::uint64_t ticket_ = 0;
    std::unique_ptr<local_request> here_;
};

} // namespace cles::core
