// SPDX-License-Identifier: BSL-1.0
#include "node/local_node.hpp"
#include "node/membership/gossip.hpp"
#include "node/routing/router.hpp"
#include "node/routing/service_registry.hpp"
#include "node/sharing/work_sharing.hpp"

#include <memory>
#include <utility>

namespace cles::core {
namespace {

/// Sharing of a node, which sends its messages on the node's channels.
class sharing_driver final : private work_sharing::client, public work_sharing {
  public:
    sharing_driver(local_node& host, shareable_queue& jobs)
        : work_sharing(host.node(), *this, jobs, host.environment().random()), host_(host) {}
    sharing_driver(const sharing_driver&) = delete;
    sharing_driver& operator=(const sharing_driver&) = delete;
    ~sharing_driver() override { withdraw_all(); }

  private:
    [[nodiscard]] const service_registry* registry() const override {
        const auto* const router = host_.node().active_router;
        return router != nullptr ? &router->registry() : nullptr;
    }
    // Not by datagrams: if the node restarts, it does not know a job that it has run, and would refuse its copy.
    [[nodiscard]] bool is_neighbour(const known_node& other) const override {
        auto* const routes = host_.node().gossip_responder;
        return other.live && other.reachable() && (routes == nullptr || !routes->reach().is_beyond(other.name)) &&
               !host_.peer_channels().is_by_datagram(other.name);
    }
    std::uint64_t forward(const forwarding_permit& permit, const protocol::outgoing_request& r, time_point due,
                          detail::pending_ptr reply, outbound::progress_function progress) override {
        return host_.peer_channels().send({.target = permit.node(), .forwarded = true}, r, due, std::move(reply),
                                          std::move(progress));
    }
    void send_own(const protocol::outgoing_request& r, time_point due, detail::pending_ptr reply) override {
        host_.peer_channels().send({.target = r.target()}, r, due, std::move(reply), {});
    }
    void cancel(std::uint64_t ticket) override { host_.cancel(ticket); }
    std::uint32_t random() override { return host_.environment().random(); }

    local_node& host_;
};

} // namespace

std::unique_ptr<job_sharing> make_sharing(local_node& host, shareable_queue& jobs) {
    return std::make_unique<sharing_driver>(host, jobs);
}

} // namespace cles::core
