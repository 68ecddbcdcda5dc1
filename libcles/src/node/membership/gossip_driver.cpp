// SPDX-License-Identifier: BSL-1.0
#include "node/membership/gossip_driver.hpp"

#include <cles/gossip.hpp>

#include "node/local_node.hpp"
#include "node/membership/discovery.hpp"
#include "node/routing/peer_channels.hpp"
#include "node/session/outbound.hpp"
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <memory>
#include <utility>

namespace cles::core {
namespace {

/// Receives the reply to a gossip request.
class table_reply final : public detail::pending {
  public:
    enum class question : std::uint8_t { table, who };

    /// `asks` lives as long as `host`.
    table_reply(std::weak_ptr<local_node> host, core::gossip& asks, question what, std::uint64_t ticket)
        : host_(std::move(host)), asks_(asks), what_(what), ticket_(ticket) {}

    verdict offer(std::string_view json) override {
        const std::unique_ptr<table_reply> self{this};
        if (const auto host = running_host()) {
            if (what_ == question::table) {
                asks_.on_answer(ticket_, json, host->now());
            } else {
                asks_.on_description(ticket_, json, host->now());
            }
        }
        return verdict::completed;
    }
    void fail(boost::system::error_code, std::string_view) override {
        const std::unique_ptr<table_reply> self{this};
        if (const auto host = running_host()) {
            asks_.on_failure(ticket_, host->now());
        }
    }
    void discard() noexcept override { delete this; }
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

  private:
    [[nodiscard]] std::shared_ptr<local_node> running_host() const {
        auto host = host_.lock();
        return host && !host->stopped() ? host : nullptr;
    }

    std::weak_ptr<local_node> host_;
    core::gossip& asks_;
    question what_;
    std::uint64_t ticket_;
};

void send(local_node& host, std::string_view url, cles::verb verb, std::string_view noun, std::string_view adverbs,
          std::string_view body, detail::pending_ptr operation) {
    host.peer_channels().send("self", url, {.verb = verb, .noun = noun, .adverbs = adverbs, .body = body},
                              host.now() + core::gossip::limit, std::move(operation), {});
}

} // namespace

gossip_driver::gossip_driver(local_node& host, std::uint32_t seed)
    : host_(host), gossip_({host.node().name, host.node().epoch}, *this, host.node().peers, host.node().counts,
                           host.deadlines(), host.bounds().peers, seed) {
    host.node().gossip_responder = &gossip_;
}

gossip_driver::~gossip_driver() { host_.node().gossip_responder = nullptr; }

void gossip_driver::set_seeds(const std::vector<std::string>& seeds) {
    for (const auto& seed : seeds) {
        const auto where = parse_url(seed);
        if (!host_.environment().has_transport(where.scheme)) {
            throw error(errc::unknown_scheme, "'" + where.scheme + "' in '" + seed + "'");
        }
    }
    gossip_.set_seeds(seeds, host_.now());
}

void gossip_driver::start() { gossip_.start(host_.now()); }

void gossip_driver::leave() { gossip_.leave(host_.now()); }

void gossip_driver::stop() {
    gossip_.stop(host_.now());
    host_.node().gossip_responder = nullptr;
}

void gossip_driver::on_gone(std::string_view node, std::string_view where, time_point now) {
    gossip_.on_gone(node, where, now);
}

void gossip_driver::ask(std::uint64_t ticket, std::string_view url, std::string_view since, std::string_view describe) {
    auto adverbs = "since=" + std::string{since};
    if (!describe.empty()) {
        adverbs.append(" describe=").append(describe);
    }
    send(host_, url, verb::pull, "self:cles/peers", adverbs, {},
         detail::pending_ptr{new table_reply{host_.weak_from_this(), gossip_, table_reply::question::table, ticket}});
}

void gossip_driver::ask_description(std::uint64_t ticket, std::string_view url) {
    send(host_, url, verb::pull, "self:cles", {}, {},
         detail::pending_ptr{new table_reply{host_.weak_from_this(), gossip_, table_reply::question::who, ticket}});
}

void gossip_driver::push(std::string_view url, std::string_view table) {
    send(host_, url, verb::push, "self:cles/peers", {}, table, detail::pending_ptr{new core::discarded_reply});
}

// Posted, because the last reply may have just arrived on this link.
void gossip_driver::release(std::string_view url) {
    core::post(host_.environment(), [weak = host_.weak_from_this(), url = std::string{url}] {
        if (const auto host = weak.lock(); host && !host->stopped()) {
            host->peer_channels().release(url);
        }
    });
}

} // namespace cles::core

namespace cles {

gossip_options gossip(std::vector<std::string> seeds) {
    static constexpr detail::gossip_part part{
        [](core::local_node& node, std::uint32_t seed) -> std::unique_ptr<detail::gossip_service> {
            return std::make_unique<core::gossip_driver>(node, seed);
        }};
    return {.seeds = std::move(seeds), .part = &part};
}

} // namespace cles
