// SPDX-License-Identifier: BSL-1.0
#include <cles/gossip.hpp>

#include "node/local_node.hpp"
#include "node/membership/discovery.hpp"
#include "node/membership/gossip.hpp"
#include "node/routing/peer_channels.hpp"
#include "node/session/outbound.hpp"
#include "port/node_security.hpp"
#include "protocol/request_line.hpp"

#include <boost/system/errc.hpp>
#include <boost/system/error_code.hpp>

#include <memory>
#include <string>
#include <utility>

namespace cles::core {
namespace {

/// The gossip of a service, which sends its requests on the service's channels.
class gossip_driver final : private gossip::client, public gossip {
  public:
    gossip_driver(local_node& host, std::uint32_t seed)
        : gossip({host.node().name, host.node().epoch}, *this, host.node().peers, host.node().counts, host.deadlines(),
                 host.bounds().peers, seed, host.node().security.get()),
          host_(host) {}

  private:
    void ask(std::uint64_t ticket, const destination& at, const table_question& what) override {
        auto adverbs = "since=" + std::string{what.since};
        if (!what.describe.empty()) {
            adverbs.append(" describe=").append(what.describe);
        }
        if (what.routes.distance != 0) {
            adverbs.append(" routes=").append(std::to_string(what.routes.distance)).append(".").append(what.routes.by);
        }
        send(at, {.verb = verb::pull, .noun = "self:cles/peers", .adverbs = adverbs},
             reply_to(ticket, &gossip::on_answer));
    }
    void ask_description(std::uint64_t ticket, const destination& at) override {
        send(at, {.verb = verb::pull, .noun = "self:cles"}, reply_to(ticket, &gossip::on_description));
    }
    void push(const destination& at, std::string_view table) override {
        send(at, {.verb = verb::push, .noun = "self:cles/peers", .body = table},
             detail::pending_ptr{new discarded_reply});
    }
    // Posted, because the last reply may have just arrived on this link.
    void release(const destination& at) override {
        host_.post_while_running([url = std::string{at.url}, node = std::string{at.node}](local_node& host) {
            host.peer_channels().release(url, node);
        });
    }

    [[nodiscard]] bool forwards_for(std::string_view neighbour) const override {
        return host_.node().active_router != nullptr && may_forward(host_.node().name, neighbour);
    }
    [[nodiscard]] bool may_forward(std::string_view forwarder, std::string_view requester) const override {
        const auto& node = host_.node();
        return !node.security ||
               node.security->may_forward(forwarder, requester.empty() ? std::string_view{node.name} : requester);
    }
    [[nodiscard]] bool is_member(std::string_view node) const override {
        const auto& security = host_.node().security;
        return !security || security->is_member(node);
    }
    // Posted, because they may be called from inside the channels.
    void on_route_lost(std::string_view node, std::string_view address) override {
        host_.post_while_running([node = std::string{node}, address = std::string{address}](local_node& host) {
            host.feeds().on_route_lost(node, address);
        });
    }
    void on_route_changed(std::string_view node) override {
        host_.post_while_running(
            [node = std::string{node}](local_node& host) { host.peer_channels().on_route_changed(node); });
    }

    void on_seeds_heard() override {
        host_.post_while_running([](local_node& host) { host.discovery().on_seeds_heard(); });
    }
    void on_stated_roster(std::string_view node, std::uint32_t version) override {
        if (const auto& secured = host_.node().secured) {
            secured->on_stated_roster(node, version, host_.now());
        }
    }

    /// The operation of a request, whose reply is passed to `taken`. This lives as long as the node.
    detail::pending_ptr reply_to(std::uint64_t ticket,
                                 void (gossip::*taken)(std::uint64_t, std::string_view, time_point)) {
        return host_.reply_while_running([this, ticket, taken](local_node& host, const peer_answer& answer) {
            if (answer.code) {
                on_failure(ticket, host.now(), answer.refusal.empty() && is_of_link(answer.code));
            } else {
                (this->*taken)(ticket, answer.json, host.now());
            }
        });
    }
    /// Whether the link is to blame: it could not be opened, was lost, or carries nothing.
    static bool is_of_link(boost::system::error_code code) {
        return code == errc::unavailable || code == errc::deadline ||
               (code.category() != error_category() && code != boost::system::errc::too_many_files_open);
    }
    void send(const destination& at, const protocol::outgoing_request& request, detail::pending_ptr operation) {
        host_.peer_channels().send({.target = at.node, .at = at.url, .expected = at.node}, request, host_.now() + limit,
                                   std::move(operation));
    }

    local_node& host_;
};

} // namespace
} // namespace cles::core

namespace cles {

gossip_options gossip(text_list seeds, text_list links) {
    static constexpr detail::gossip_part part{
        [](core::local_node& node, std::uint32_t seed) -> std::unique_ptr<core::gossip> {
            return std::make_unique<core::gossip_driver>(node, seed);
        }};
    return {.seeds = std::move(seeds), .links = std::move(links), .part = &part};
}

} // namespace cles
