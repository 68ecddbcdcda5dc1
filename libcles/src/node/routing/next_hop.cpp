// SPDX-License-Identifier: BSL-1.0
#include "node/routing/next_hop.hpp"

#include <cles/feed_event.hpp>
#include <cles/pending.hpp>
#include <cles/routing.hpp>

#include "node/base/peer_reply.hpp"
#include "node/local_node.hpp"
#include "node/publish/feed_machine.hpp"
#include "node/routing/request_router.hpp"
#include "node/routing/router.hpp"
#include "protocol/grammar.hpp"
#include "protocol/reply_line.hpp"

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {
namespace {

void append_unknown(adverb_list& to, const protocol::request_line& r) {
    const auto most = std::min(max_further_adverbs(r), to.count + r.unknown_adverbs);
    protocol::part_reader parts{r.text};
    parts.next(); // verb
    parts.next(); // noun
    while (to.count < most) {
        const auto part = parts.next();
        protocol::adverb a;
        if (part.empty()) {
            return;
        }
        if (protocol::split_adverb(part, a) && !protocol::is_known_adverb(a.key, r.verb)) {
            to.text.append(" ").append(part);
            ++to.count;
        }
    }
}

// The requester that `from` states. The peer of the next node is this one.
std::string_view stated_requester(const request_origin& by, std::string_view own_name) noexcept {
    return by.requester == own_name && by.forwarder.empty() ? std::string_view{} : by.requester;
}

// Updates that the publisher keeps for this node, which stands for many clients and must lose less than any of them.
constexpr std::uint32_t upstream_keep = 1024;

protocol::failure failure_of(boost::system::error_code code, const std::string& node, std::string_view message) {
    const bool on_wire = code.category() == error_category() && wire_name(static_cast<errc>(code.value())) != "failed";
    protocol::failure why{.code = on_wire ? static_cast<errc>(code.value()) : errc::unavailable,
                          .message = std::string{message}};
    if (code == errc::failed) {
        why.code = errc::failed;
    }
    if (!why.message.starts_with(node)) {
        why.message.insert(0, node + ": ");
    }
    return why;
}

/// A noun of another node, bound for this node's clients.
class upstream_feed final : private detail::pending_event, public std::enable_shared_from_this<upstream_feed> {
  public:
    upstream_feed(std::shared_ptr<local_node> host, std::string node, std::string path, feed_events& to)
        : host_(std::move(host)), machine_(host_->feeds(), host_->deadlines(), host_->completions(), host_->bounds(),
                                           std::move(node), std::move(path), false, host_->environment().random()),
          to_(&to) {}

    void begin(const forwarding_permit& permit);
    void close();

  private:
    // pending_event: this object always waits for the next event.
    bool deliver(const detail::raw_event& event) override;
    void fail(boost::system::error_code, std::string_view) override {}
    void discard() noexcept override {}
    [[nodiscard]] bool calls_user() const noexcept override { return false; }

    void wait() { static_cast<void>(machine_.mail().next(pending_event_ptr{this})); }
    void on_first_answer(const peer_answer& found);
    void on_refused(const protocol::failure& why);
    void release_later();

    std::shared_ptr<local_node> host_;
    feed_machine machine_;
    feed_events* to_; // null: closed
};

void upstream_feed::begin(const forwarding_permit& permit) {
    machine_.entry().on_denied = [this](const std::string& why) {
        if (to_ != nullptr) {
            to_->on_denied(failure_of(errc::denied, machine_.target(), why));
        }
    };
    host_->feeds().enter(machine_, weak_from_this(),
                         {.noun = machine_.target() + ":" + machine_.path(),
                          .at = {},
                          .keep = upstream_keep,
                          .adverbs = permit.adverbs(),
                          .marked = true,
                          .via = std::string{permit.via()},
                          .requester = std::string{permit.requester()}});
    wait();
    machine_.start(detail::pending_ptr{new peer_reply{[weak = weak_from_this()](const peer_answer& found) {
        if (const auto self = weak.lock()) {
            self->on_first_answer(found);
        }
    }}});
}

void upstream_feed::on_first_answer(const peer_answer& found) {
    if (!found.code) {
        if (to_ != nullptr) {
            to_->on_bound(found.json);
        }
    } else if (found.refusal.empty()) {
        on_refused(failure_of(found.code, machine_.target(), found.message));
    } else {
        protocol::failure why;
        protocol::parse_failure(found.refusal, why);
        why.answer = found.refusal;
        on_refused(why);
    }
}

void upstream_feed::close() {
    if (std::exchange(to_, nullptr) != nullptr) {
        machine_.close(errc::cancelled);
        release_later();
    }
}

// It may be closed from inside its own event: callers on the stack still need it.
void upstream_feed::release_later() {
    post(host_->environment(), [self = shared_from_this()] {});
}

void upstream_feed::on_refused(const protocol::failure& why) {
    if (auto* to = std::exchange(to_, nullptr)) {
        release_later();
        to->on_refused(why);
    }
}

bool upstream_feed::deliver(const detail::raw_event& event) {
    if (!event.has_json()) {
        return false;
    }
    wait();
    if (to_ != nullptr && event.kind == feed_event::update) {
        to_->on_update(event.line, event.body);
    } else if (to_ != nullptr && event.kind == feed_event::current) {
        const std::string last{event.body};
        to_->on_bound(last);
    }
    return true;
}

/// Sends the requests of a node's router on the node's channels.
class peer_next_hop : public next_hop {
  public:
    explicit peer_next_hop(local_node& host) noexcept : host_(host) {}

    std::uint64_t forward(const forwarding_permit& permit, const protocol::outgoing_request& r, time_point deadline,
                          detail::pending_ptr reply, outbound::progress_function progress) override {
        return send(
            r, {.target = r.target(), .by = {.via = permit.via(), .requester = permit.requester()}, .forwarded = true},
            deadline, std::move(reply), std::move(progress));
    }
    std::uint64_t send_own(const protocol::outgoing_request& r, time_point deadline,
                           detail::pending_ptr reply) override {
        return send(r, {.target = r.target()}, deadline, std::move(reply), {});
    }
    void cancel(std::uint64_t ticket) override { host_.cancel(ticket); }
    std::shared_ptr<void> bind(const forwarding_permit& permit, std::string_view path, feed_events& to) override {
        const auto made = std::make_shared<upstream_feed>(host_.shared_from_this(), std::string{permit.node()},
                                                          std::string{path}, to);
        made->begin(permit);
        return {static_cast<void*>(made.get()), [made](void*) { made->close(); }};
    }

  private:
    std::uint64_t send(const protocol::outgoing_request& r, const peer_channels::destination& to, time_point deadline,
                       detail::pending_ptr reply, outbound::progress_function progress) {
        if (host_.stopped()) {
            host_.fail_later(std::move(reply), errc::stopped, {});
            return 0;
        }
        return host_.peer_channels().send(to, r, deadline, std::move(reply), std::move(progress));
    }

    local_node& host_;
};

/// Routes for a node.
class node_router final : private peer_next_hop, public request_router {
  public:
    explicit node_router(local_node& host)
        : peer_next_hop(host), request_router(host.shared_node(), *this, host.environment().random(),
                                              [&host] { host.flush_scheduler().schedule_turn(); }) {}
};

} // namespace

std::uint8_t hops_after(const protocol::request_line& r) noexcept {
    return static_cast<std::uint8_t>(r.hops == 0 ? 0 : r.hops - 1);
}

adverb_list forwarded_adverbs(const protocol::request_line& r, std::uint8_t hops, std::string_view own_name,
                              const request_origin& by) {
    adverb_list out{.text = "hops=" + std::to_string(hops) + " via=", .count = 2};
    const auto add = [&](std::string_view key, std::string_view value) {
        out.text.append(key).append(value);
        ++out.count;
    };
    if (!r.via.empty()) {
        out.text.append(r.via).push_back(',');
    }
    out.text.append(own_name);
    if (const auto requester = stated_requester(by, own_name); !requester.empty()) {
        add(" from=", requester);
    }
    if (!r.sig.empty()) {
        add(" sig=", r.sig);
    }
    append_unknown(out, r);
    return out;
}

std::optional<forwarding_permit> forwarding_permit::ask(node_state& n, const protocol::request_line& r,
                                                        const request_origin& by, std::string_view node,
                                                        protocol::failure& why) {
    if (const auto found = may_pass_on(n, by, node, r.verb, r.noun); found != passage::permitted) {
        why = no_passage(n, found, by, node, r.verb, r.noun.path);
        return std::nullopt;
    }
    return forwarding_permit{node, r.via, stated_requester(by, n.name),
                             forwarded_adverbs(r, hops_after(r), n.name, by).text};
}

std::optional<forwarding_permit> forwarding_permit::ask(node_state& n, const request_origin& by, std::string_view node,
                                                        verb how, std::string_view path, std::string_view via,
                                                        std::string adverbs, protocol::failure& why) {
    if (const auto found = may_pass_on(n, by, node, how, path); found != passage::permitted) {
        why = no_passage(n, found, by, node, how, path);
        return std::nullopt;
    }
    return forwarding_permit{node, via, stated_requester(by, n.name), std::move(adverbs)};
}

bool has_adverbs_to_forward(const protocol::request_line& r) noexcept {
    return !r.via.empty() || !r.sig.empty() || r.unknown_adverbs != 0;
}

// The same for each verb but BIND, which has more adverbs. docs/protocol.md states how many unknown ones that leaves.
std::size_t max_further_adverbs(const protocol::request_line& r) noexcept {
    const auto written = std::max(protocol::max_written_adverbs(r.verb), protocol::max_written_adverbs(verb::delegate));
    const std::size_t not_written = 1 + (r.trace ? 0 : 1); // `hops`, which is one of the further ones, and `trace`
    return protocol::max_adverbs - (written - not_written);
}

} // namespace cles::core

namespace cles {

const detail::routing_part* routing() noexcept {
    static constexpr detail::routing_part part{[](core::local_node& host) -> std::shared_ptr<core::router> {
        return std::make_shared<core::node_router>(host);
    }};
    return &part;
}

} // namespace cles
