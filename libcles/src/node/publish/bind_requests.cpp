// SPDX-License-Identifier: BSL-1.0
#include "node/publish/bind_requests.hpp"

#include <cles/error.hpp>

#include "node/base/deadlines.hpp"
#include "node/routing/router.hpp"
#include "node/routing/subrequest.hpp"
#include "node/session/handler_failure.hpp"
#include "node/session/inbound.hpp"
#include "node/session/request_checks.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::core {

namespace {

std::string head_of(const topic& t, bool wants_mark) {
    return wants_mark ? protocol::mark_text(t.last_mark()) : std::string{};
}

} // namespace

bind_requests::bind_requests(std::shared_ptr<node_state> host, line_sink& out, subscriber& updates,
                             const identity& peer, reply_writer& replies)
    : shared_node_(std::move(host)), node_(*shared_node_), peer_(peer), out_(out), replies_(replies), updates_(updates),
      bound_(node_.published, updates), leases_(node_.deadlines, [this](const leased& which) {
          ++node_.counts.leases_expired;
          drop(which);
      }) {}

void bind_requests::clear() {
    leases_.clear();
    pending_.clear();
    remote_bindings_.reset();
    requesters_.clear();
    bound_.clear();
}

void bind_requests::drain(time_point now) {
    bound_.drain(now);
    if (remote_bindings_) {
        remote_bindings_->drain(now);
    }
}

void bind_requests::drop(const leased& which) {
    leases_.drop(which);
    if (which.node.empty()) {
        requesters_.erase(which.path.text);
        bound_.unbind(which.path.text);
    } else if (remote_bindings_) {
        remote_bindings_->unbind(which.node, which.path);
    }
}

std::vector<bind_requests::leased> bind_requests::forbidden() const {
    std::vector<leased> found;
    for (const auto& [path, all] : requesters_) {
        // clang 14 captures no structured binding by itself.
        const auto is_forbidden = [&, &bound = path](const owned_origin& by) {
            return !permits(node_, by, node_.name, verb::bind, bound);
        };
        if (std::ranges::any_of(all, is_forbidden)) {
            found.push_back({{}, {path}});
        }
    }
    if (remote_bindings_) {
        for (auto& [node, path] : remote_bindings_->forbidden(node_)) {
            found.push_back({std::move(node), std::move(path)});
        }
    }
    return found;
}

void bind_requests::drop_forbidden() {
    for (const auto& which : forbidden()) {
        drop(which);
    }
}

void bind_requests::serve_remote(const protocol::request_line& r, time_point due, time_point now, inbound& from) {
    std::string scratch;
    const auto by = origin_of(node_, peer_, r);
    const leased which{std::string{r.noun.target}, {std::string{protocol::canonical_path(r.noun, scratch)}, by}};
    if (r.unbinds()) {
        drop(which);
        replies_.done(reply_target{r}, {});
        return;
    }
    // A binding that exists already needs no further capacity.
    const bool known = remote_bindings_ && remote_bindings_->binds(which.node, which.path);
    if (!known && size() >= node_.bounds.bindings) {
        replies_.fail(r, errc::busy, node_.name + ": too many bindings on this link");
        return;
    }
    if (!remote_bindings_) {
        remote_bindings_ =
            std::make_unique<relayed_bindings>(node_.published, bound_, node_.active_router->relayed(), updates_);
    }
    set_lease(which, r, now);
    node_.active_router->bind(r, by, *remote_bindings_, due, now, from);
}

void bind_requests::set_lease(const leased& which, const protocol::request_line& r, time_point now) {
    if (out_.is_datagram()) {
        const std::chrono::milliseconds lease{r.lease_ms.value_or(protocol::default_lease_ms)};
        leases_.set(which, saturating_add(now, lease));
    }
}

void bind_requests::bind(topic& t, const protocol::request_line& r, std::string_view path, time_point now) {
    bound_.bind(t, {.every = std::chrono::milliseconds{r.every_ms}, .keep = r.keep});
    if (node_.security) {
        requesters_[std::string{path}].insert(origin_of(node_, peer_, r));
    }
    set_lease({{}, {std::string{path}}}, r, now);
}

void bind_requests::serve(const protocol::request_line& r, time_point due, time_point now, inbound& from) {
    std::string scratch;
    const auto path = protocol::canonical_path(r.noun, scratch);
    if (r.unbinds()) {
        withdraw(path);
        drop({{}, {std::string{path}}});
        replies_.done(reply_target{r}, {});
        return;
    }
    auto& published = node_.published;
    if (!node_.tasks.can_bind(r.noun.task) && !published.knows(r.noun.task)) {
        replies_.fail(r, errc::no_task, node_.name + " has no BIND '" + std::string{r.noun.task} + "'");
        return;
    }
    if (is_bind_decided_later(node_, r)) {
        serve_later(r, path, due, now, from);
        return;
    }
    try {
        ask_bind_handler(node_, peer_, r);
        auto& t = open(path, r);
        replies_.done(reply_target{r}, t.last_body(), head_of(t, r.wants_mark));
        bind(t, r, path, now);
    } catch (...) {
        replies_.fail(r, describe(std::current_exception()));
    }
}

topic& bind_requests::open(std::string_view path, const protocol::request_line& r) {
    if ((!bound_.has(path) && bound_.size() >= node_.bounds.bindings) || !has_room_for_requester(path, r)) {
        throw error(errc::busy, node_.name + ": too many bindings on this link");
    }
    // Checked first: a BIND that cannot be answered must not bind.
    constexpr std::size_t head = 64;
    const auto* known = node_.published.find(path);
    if (!out_.reserve((known != nullptr ? known->last_body().size() : 0) + head)) {
        throw error(errc::busy, no_memory(node_).message);
    }
    return node_.published.open(path);
}

// Each member for which the peer binds a noun counts.
bool bind_requests::has_room_for_requester(std::string_view path, const protocol::request_line& r) const {
    if (r.from.empty()) {
        return true;
    }
    const auto at = requesters_.find(path);
    if (at != requesters_.end() && at->second.contains(origin_of(node_, peer_, r))) {
        return true;
    }
    std::size_t known = 0;
    for (const auto& [noun, all] : requesters_) {
        known += all.size();
    }
    return known < std::max(max_requesters, node_.bounds.bindings);
}

void bind_requests::serve_later(const protocol::request_line& r, std::string_view path, time_point due, time_point now,
                                inbound& from) {
    const auto c = from.make_call(r, due, now);
    if (!c) {
        return;
    }
    std::erase_if(pending_, [](const asking& a) {
        const auto waits = a.answers.lock();
        return !waits || waits->ended();
    });
    pending_.push_back({std::string{path}, c});
    const auto handler = std::make_shared<local_request>(
        shared_node_, [this, c, path = std::string{path}, wanted = std::make_shared<protocol::owned_request>(r)](
                          std::string_view, const subrequest_failure* why_not) {
            if (c->ended()) { // `this` may be gone with its link
                return;
            }
            if (why_not != nullptr) {
                c->fail(why_not->reported);
                return;
            }
            try {
                if (!permits(node_, origin_of(node_, peer_, **wanted), node_.name, verb::bind, path)) {
                    throw error(errc::denied, "the right to bind '" + path + "' was withdrawn");
                }
                auto& t = open(path, **wanted);
                // Bound before the reply, which may set off other requests of the peer; updates follow it later.
                bind(t, **wanted, path, node_.time.now());
                c->set_head(head_of(t, (*wanted)->wants_mark));
                c->done(t.last_body());
            } catch (...) {
                c->fail(describe(std::current_exception()));
            }
        });
    c->on_stop([handler] { handler->withdraw(); });
    handler->run(r, peer_, due, now);
}

void bind_requests::withdraw(std::string_view path) {
    for (const auto& a : std::vector<asking>{pending_}) {
        if (a.path != path) {
            continue;
        }
        if (const auto c = a.answers.lock(); c && !c->ended()) {
            c->abort({.code = errc::cancelled, .message = node_.name + ": it was unbound"});
        }
    }
}

void ask_bind_handler(const node_state& host, const identity& peer, const protocol::request_line& r) {
    const auto* h = host.tasks.find(verb::bind, r.noun.task);
    if (h == nullptr || !h->plain) {
        return;
    }
    std::string decoded;
    const auto parameters = decode(r.noun, decoded);
    const auto by = origin_of(host, peer, r);
    const cles::detail::request_data data{.verb = r.verb,
                                          .node = host.name,
                                          .task = r.noun.task,
                                          .parameters = {parameters.data(), parameters.size()},
                                          .peer = &peer,
                                          .deadline = {},
                                          .requester = by.requester,
                                          .forwarded_by = by.forwarder};
    std::string unused;
    json_writer w{unused};
    h->plain(cles::request{data}, w);
}

bool is_bind_decided_later(const node_state& host, const protocol::request_line& r) {
    const auto* h = host.tasks.find(verb::bind, r.noun.task);
    return h != nullptr && h->start;
}

} // namespace cles::core
