// SPDX-License-Identifier: BSL-1.0
#include "core/bind_requests.hpp"

#include "core/handler_failure.hpp"
#include "core/request_checks.hpp"

#include <chrono>
#include <string>

namespace cles::core {

bind_requests::bind_requests(node& host, const outlet& out, binder& updates, const identity& peer,
                             reply_writer& replies)
    : node_(host), peer_(peer), replies_(replies), bound_(host.published, updates) {
    if (out.datagram() != 0) {
        leases_.emplace(host.deadlines, [this](const std::string& path) {
            ++node_.counts.leases_expired;
            bound_.unbind(path);
        });
    }
}

void bind_requests::clear() {
    if (leases_) {
        leases_->clear();
    }
    bound_.clear();
}

void bind_requests::serve(const protocol::request_line& r, time_point now) {
    std::string scratch;
    const auto path = protocol::canonical_path(r.noun, scratch);
    if (r.unbinds()) {
        if (leases_) {
            leases_->drop(path);
        }
        bound_.unbind(path);
        replies_.done(r.id, r.wants_reply, {});
        return;
    }
    auto& published = node_.published;
    if (!node_.tasks.can_bind(r.noun.task) && !published.knows(r.noun.task)) {
        replies_.fail(r, errc::no_task, node_.name + " has no BIND '" + std::string{r.noun.task} + "'");
        return;
    }
    try {
        ask_bind_handler(node_, peer_, r);
        if (!bound_.has(path) && bound_.size() >= node_.bounds.bindings) {
            replies_.fail(r, errc::busy, node_.name + ": too many bindings on this link");
            return;
        }
        auto& t = published.open(path);
        replies_.done(r.id, r.wants_reply, t.last_body());
        bound_.bind(t, {.every = std::chrono::milliseconds{r.every_ms}, .keep = r.keep});
        if (leases_) {
            leases_->set(path, now + std::chrono::milliseconds{r.lease_ms.value_or(protocol::default_lease_ms)});
        }
    } catch (...) {
        replies_.fail(r, describe(std::current_exception()));
    }
}

void ask_bind_handler(const node& host, const identity& peer, const protocol::request_line& r) {
    const auto* h = host.tasks.find(verb::bind, r.noun.task);
    if (h == nullptr || !h->plain) {
        return;
    }
    std::string decoded;
    const auto parameters = decode(r.noun, decoded);
    const cles::detail::request_data data{.verb = r.verb,
                                          .node = host.name,
                                          .task = r.noun.task,
                                          .parameters = {parameters.data(), parameters.size()},
                                          .peer = &peer,
                                          .deadline = {}};
    std::string unused;
    json_writer w{unused};
    h->plain(cles::request{data}, w);
}

} // namespace cles::core
