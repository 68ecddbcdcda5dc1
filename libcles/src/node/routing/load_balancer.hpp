// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/backoff.hpp"
#include "node/node_state.hpp"
#include "node/routing/service_registry.hpp"
#include "port/request_origin.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Whether one more piece of work is probably done sooner by `a` than by `b`.
[[nodiscard]] bool is_better(const candidate& a, const candidate& b) noexcept;

/// Selects the node for a piece of work: draws two at random and takes the better one. This keeps the longest queue
/// short although loads are outdated; if all took the best one, they would overload the same node (Mitzenmacher, The
/// Power of Two Choices in Randomized Load Balancing, 2001).
class power_of_two_choices {
  public:
    explicit power_of_two_choices(std::uint32_t seed) noexcept : draws_(seed) {}

    /// Null if there are none.
    [[nodiscard]] candidate* select(std::span<candidate* const> all) noexcept;

  private:
    jitter draws_;
};

/// Selects the node that serves a request for `any`. This node counts too.
class load_balancer {
  public:
    load_balancer(const node_state& host, const service_registry& others, std::uint32_t seed) noexcept
        : node_(host), others_(others), selector_(seed) {}

    struct chosen {
        known_node* other = nullptr; ///< null: this node, or none
        bool here = false;
        bool idempotent = false;
        bool not_forwarded = false; ///< a node is left out only because this one may not forward for the requester

        [[nodiscard]] bool nobody() const noexcept { return other == nullptr && !here; }
    };
    /// Selects a live node that offers the task, is not in `via` and is not in `asked`. Busy and unreachable nodes are
    /// selected only if there are no others, and nodes with all workers on long jobs only if no node has a free worker.
    /// Of a secured fleet, only nodes of which the requester may request it, by this one.
    [[nodiscard]] chosen choose(const protocol::request_line& r, const request_origin& by,
                                const std::vector<std::string>& asked, time_point now);
    /// This node has refused work.
    void avoid_local(time_point until) noexcept { here_.avoid_until = until; }

  private:
    /// Lists those that can serve it. Returns whether one is left out only because this node may not forward.
    bool gather(const protocol::request_line& r, const request_origin& by, const std::vector<std::string>& asked);

    const node_state& node_;
    const service_registry& others_;
    power_of_two_choices selector_;
    candidate here_;
    std::vector<candidate*> all_;     // for the current request
    std::vector<candidate*> at_once_; // of these, the nodes not to be avoided
};

/// Whether this node offers the task.
bool offers(const node_state& n, verb v, std::string_view task);

} // namespace cles::core
