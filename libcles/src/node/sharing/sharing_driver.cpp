// SPDX-License-Identifier: BSL-1.0
#include "node/sharing/sharing_driver.hpp"

#include "node/membership/discovery.hpp"
#include "node/membership/gossip.hpp"
#include "node/routing/router.hpp"
#include "node/routing/service_registry.hpp"

#include <memory>
#include <string>
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
    void push_slots(std::string_view node, std::uint64_t grant, std::string_view body, slots_reply then) override {
        const auto adverbs = grant != 0 ? "grant=" + protocol::grant_text(grant) : std::string{};
        const auto noun = std::string{node} + ":cles/slots";
        auto operation = detail::pending_ptr{new peer_reply{
            host_.weak_from_this(),
            [then = std::move(then)](local_node&, const peer_answer& answer) { then(answer.json, answer.code); },
            true}};
        host_.peer_channels().send(node, {}, {.verb = verb::push, .noun = noun, .adverbs = adverbs, .body = body},
                                   host_.now() + slot_grants::valid_for, std::move(operation), {});
    }
    std::uint64_t forward(const protocol::outgoing_request& r, time_point due, detail::pending_ptr reply,
                          outbound::progress_function progress) override {
        return host_.peer_channels().send(r.target(), {}, r, due, std::move(reply), std::move(progress));
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
