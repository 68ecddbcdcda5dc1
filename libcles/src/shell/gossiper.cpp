// SPDX-License-Identifier: BSL-1.0
#include "shell/gossiper.hpp"

#include "core/ignored_reply.hpp"
#include "protocol/message.hpp"
#include "shell/local_node.hpp"
#include "shell/route.hpp"

#include <memory>
#include <utility>

namespace cles::shell {
namespace {

/// The answer to a question of gossip.
class table_reply final : public detail::pending {
  public:
    enum class question : std::uint8_t { table, who };

    /// The machine lives as long as the host does.
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
    boost::system::error_code code;
    std::string why;
    auto* way = host.routes().to("self", url, false, code, why);
    if (way == nullptr) {
        host.fail_later(std::move(operation), code, std::move(why));
        return;
    }
    const auto now = host.now();
    way->send({.verb = verb,
               .noun = noun,
               .adverbs = adverbs,
               .body = body,
               .id = host.draw_id(),
               .begun = now,
               .deadline = now + core::gossip::limit},
              std::move(operation), {});
}

} // namespace

gossiper::gossiper(local_node& host, std::uint32_t seed)
    : host_(host), gossip_({host.node().name, host.node().epoch}, *this, host.node().others, host.node().counts,
                           host.deadlines(), host.bounds().peers, seed) {
    host.node().talk = &gossip_;
}

gossiper::~gossiper() { host_.node().talk = nullptr; }

void gossiper::set_seeds(const std::vector<std::string>& seeds) {
    for (const auto& seed : seeds) {
        const auto where = parse_url(seed);
        if (!host_.environment().has_transport(where.scheme)) {
            throw error(errc::unknown_scheme, "'" + where.scheme + "' in '" + seed + "'");
        }
    }
    gossip_.set_seeds(seeds, host_.now());
}

void gossiper::start() { gossip_.start(host_.now()); }

void gossiper::leave() { gossip_.leave(host_.now()); }

void gossiper::stop() {
    gossip_.stop(host_.now());
    host_.node().talk = nullptr;
}

void gossiper::on_gone(std::string_view node, std::string_view where, time_point now) {
    gossip_.on_gone(node, where, now);
}

void gossiper::ask(std::uint64_t ticket, std::string_view url, std::string_view since, std::string_view describe) {
    auto adverbs = "since=" + std::string{since};
    if (!describe.empty()) {
        adverbs.append(" describe=").append(describe);
    }
    send(host_, url, verb::pull, "self:cles/peers", adverbs, {},
         detail::pending_ptr{new table_reply{host_.weak_from_this(), gossip_, table_reply::question::table, ticket}});
}

void gossiper::ask_who(std::uint64_t ticket, std::string_view url) {
    send(host_, url, verb::pull, "self:cles", {}, {},
         detail::pending_ptr{new table_reply{host_.weak_from_this(), gossip_, table_reply::question::who, ticket}});
}

void gossiper::tell(std::string_view url, std::string_view table) {
    send(host_, url, verb::push, "self:cles/peers", {}, table, detail::pending_ptr{new core::ignored_reply});
}

// The link may be the one by which the last answer has just come.
void gossiper::release(std::string_view url) {
    core::post(host_.environment(), [weak = host_.weak_from_this(), url = std::string{url}] {
        if (const auto host = weak.lock(); host && !host->stopped()) {
            host->routes().release(url);
        }
    });
}

} // namespace cles::shell
