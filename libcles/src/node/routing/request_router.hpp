// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/node_state.hpp"
#include "node/routing/load_balancer.hpp"
#include "node/routing/next_hop.hpp"
#include "node/routing/relays.hpp"
#include "node/routing/router.hpp"
#include "node/routing/service_registry.hpp"
#include "node/routing/subrequest.hpp"
#include "node/session/call.hpp"
#include "node/session/outbound.hpp"

#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

class all_binding;
class deferred_request;
struct attempt;

/// Serves the requests of a node's clients that are not for it alone: forwards those that name another node, selects a
/// node for `any`, and sends those for `all` to all nodes (docs/protocol.md, "Routing").
class request_router : public router, public std::enable_shared_from_this<request_router> {
  public:
    /// `wake` is called when a turn is needed: requests are ready to start.
    request_router(std::shared_ptr<node_state> host, next_hop& out, std::uint32_t seed, std::function<void()> wake);
    ~request_router() override;

    bool route(const protocol::request_line& request, const identity& peer, time_point due, time_point now,
               inbound& from) override;
    void continue_after_busy(const protocol::request_line& request, const identity& peer, const protocol::failure& why,
                             time_point due, time_point now, inbound& from) override;
    void bind(const protocol::request_line& request, const request_origin& by, relayed_bindings& place, time_point due,
              time_point now, inbound& from) override;
    std::shared_ptr<relays> relayed() override { return relays_; }
    [[nodiscard]] const service_registry& registry() const noexcept override { return service_registry_; }
    void hold() noexcept override { waits_for_discovery_ = true; }
    void release(bool expects_nodes) override;
    void on_rights_changed() override { on_offers(); }
    void begin_ready(time_point now) override;
    void stop() final;

    // For deferred requests.
    [[nodiscard]] node_state& host() noexcept { return *node_; }
    [[nodiscard]] load_balancer::chosen choose(const protocol::request_line& r, const request_origin& by,
                                               const std::vector<std::string>& asked, time_point now) {
        return load_balancer_.choose(r, by, asked, now);
    }
    void avoid_local(time_point until) noexcept { load_balancer_.avoid_local(until); }
    [[nodiscard]] known_node* find(std::string_view name) noexcept { return service_registry_.find(name); }
    [[nodiscard]] const std::vector<service_registry::offer>& offers(verb v, std::string_view task) const {
        return service_registry_.offers(v, task);
    }
    /// Sends `r`, of that origin, to another node. Returns a ticket; 0 if it may not leave: `then` is called at once.
    std::uint64_t send(const protocol::request_line& r, const request_origin& by, std::string_view node, time_point due,
                       subrequest_outcome then, outbound::progress_function progress = {});
    /// Cancels it, if it is still in progress.
    void cancel(const attempt& part);
    /// Has `e` started in the next turn, and owns it until then.
    void schedule(std::shared_ptr<deferred_request> e);
    [[nodiscard]] bool waits_for_discovery() const noexcept { return waits_for_discovery_; }
    [[nodiscard]] bool expects_more() const noexcept {
        return waits_for_discovery_ || service_registry_.expects_more();
    }
    /// Whether seeds may still answer: a request without a provider waits.
    [[nodiscard]] bool expects_nodes() const noexcept { return expects_nodes_; }
    [[nodiscard]] bool stopped() const noexcept { return stopped_; }
    [[nodiscard]] protocol::failure no_provider(const protocol::request_line& r) const;
    /// It has been forwarded as often as it may be.
    [[nodiscard]] protocol::failure no_hops_left(const protocol::request_line& r) const;

  private:
    void on_offers();
    void begin(std::shared_ptr<deferred_request> e, time_point now);
    void forward(const protocol::request_line& r, const request_origin& by, std::shared_ptr<call> c, time_point due);
    bool runs_in_line(const protocol::request_line& r) const;

    std::shared_ptr<node_state> node_;
    next_hop& out_;
    service_registry service_registry_;
    load_balancer load_balancer_;
    std::shared_ptr<relays> relays_;
    std::list<std::shared_ptr<deferred_request>> waiting_;
    std::deque<std::shared_ptr<deferred_request>> ready_; // for the next turn
    std::function<void()> wake_;
    std::vector<std::weak_ptr<all_binding>> all_;
    bool waits_for_discovery_ = false;
    bool expects_nodes_ = false;
    bool stopped_ = false;
};

} // namespace cles::core
