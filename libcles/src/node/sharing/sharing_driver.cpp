// SPDX-License-Identifier: BSL-1.0
#include "node/sharing/sharing_driver.hpp"

#include "node/membership/discovery.hpp"
#include "node/membership/gossip.hpp"
#include "node/routing/router.hpp"
#include "node/routing/service_registry.hpp"

#include <algorithm>
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
    [[nodiscard]] const service_registry* registry() const {
        const auto* const router = host_.node().active_router;
        return router != nullptr ? &router->registry() : nullptr;
    }
    // Not by datagrams: if the node restarts, it does not know a job that it has run, and would refuse its copy.
    [[nodiscard]] bool is_neighbour(const known_node& other) const {
        auto* const routes = host_.node().gossip_responder;
        return other.live && other.reachable() && (routes == nullptr || !routes->reach().is_beyond(other.name)) &&
               !host_.peer_channels().is_by_datagram(other.name);
    }
    void list_neighbours(std::vector<neighbour>& to) const override {
        if (const auto* const others = registry()) {
            for (const auto& [name, other] : others->nodes()) {
                if (is_neighbour(*other)) {
                    to.push_back({name, other->load, host_.node().peers.last_seen(name)});
                }
            }
        }
    }
    [[nodiscard]] bool offers(std::string_view node, std::string_view task) const override {
        const auto* const others = registry();
        const auto* const other = others != nullptr ? others->find(node) : nullptr;
        if (other == nullptr || !is_neighbour(*other) || !other->tasks) {
            return false;
        }
        const auto& all = other->tasks->entries;
        return std::any_of(all.begin(), all.end(),
                           [&](const auto& each) { return each.verb == verb::delegate && each.task == task; });
    }
    void push_slots(std::string_view node, std::uint64_t grant, std::string_view body) override {
        const auto adverbs = grant != 0 ? "grant=" + protocol::grant_text(grant) : std::string{};
        const auto noun = std::string{node} + ":cles/slots";
        auto operation = detail::pending_ptr{new peer_reply{
            host_.weak_from_this(),
            [weak = alive(), node = std::string{node}, grant](local_node& host, const peer_answer& answer) {
                if (const auto self = weak.lock()) {
                    (*self)->on_reply(node, grant, answer.json, host.now());
                }
            },
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
