// SPDX-License-Identifier: BSL-1.0
#include "node/routing/all_binding.hpp"

#include "node/session/request_checks.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace cles::core {

all_binding::all_binding(std::shared_ptr<request_router> by, const protocol::request_line& r, relayed_path path,
                         relayed_bindings& place, binding::terms wanted, std::shared_ptr<call> answers, time_point due)
    : deferred_request(std::move(by), std::move(answers), due), request_(r), path_(std::move(path)), place_(place),
      wanted_(wanted) {}

bool all_binding::may_bind_here() const {
    const auto& host = routing_->host();
    return permits(host, path_.by, host.name, verb::bind, path_.text);
}

passage all_binding::may_bind_at(std::string_view node) const {
    return may_pass_on(routing_->host(), path_.by, node, verb::bind, path_.text);
}

bool all_binding::is_permitted() const {
    return std::ranges::all_of(parts_, [this](const auto& entry) {
        const auto& [node, p] = entry;
        return node == routing_->host().name ? may_bind_here() : p.held_back || may_bind_at(node) == passage::permitted;
    });
}

bool all_binding::begin(time_point now) {
    if (begun_) {
        return true;
    }
    if (routing_->expects_more()) {
        if (!armed()) {
            routing_->host().deadlines.arm(*this, stop_waiting_at(reply_due_, now));
        }
        return false;
    }
    bind_known(now);
    return true;
}

void all_binding::bind_known(time_point now) {
    begun_ = true;
    if (call_->ended()) { // cancelled while it waited
        place_.unbind("all", path_);
        return;
    }
    follow_call();
    routing_->host().deadlines.arm(*this, answer_by(reply_due_, now));
    follow();
}

void all_binding::withdraw() {
    if (!closed_) {
        place_.unbind("all", path_);
    }
}

void all_binding::follow() {
    if (!begun_ || closed_) {
        return;
    }
    const auto self = shared_from_this();
    joining_ = true;
    const auto& host = routing_->host();
    if (!parts_.contains(host.name) && core::offers(host, verb::bind, request_->noun.task) && may_bind_here()) {
        auto& own = parts_[host.name];
        own.asked = false;
        if (const auto* t = place_.take_own_part(path_.text, wanted_)) {
            own.result = t->last_body().empty() ? std::string_view{"{}"} : t->last_body();
            own.mark = t->last_mark();
        }
    }
    if (request_->hops != 0) {
        std::vector<std::string> there;
        for (const auto& o : routing_->offers(verb::bind, request_->noun.task)) {
            if (!is_in_via(request_->via, o.by->name) && may_bind_at(o.by->name) != passage::not_permitted) {
                there.push_back(o.by->name);
            }
        }
        for (const auto& name : there) {
            if (const auto known = parts_.find(name); known == parts_.end() || known->second.held_back) {
                join(name);
            }
        }
        // A removed node is bound anew when it returns; until it is removed, its feed rebinds by itself.
        std::erase_if(parts_, [&](const auto& entry) {
            const auto& [name, p] = entry;
            return p.failure && !p.bound && name != routing_->host().name &&
                   std::find(there.begin(), there.end(), name) == there.end();
        });
    }
    joining_ = false;
    reply_when_complete();
}

void all_binding::join(const std::string& node) {
    auto& p = parts_[node];
    p = {};
    protocol::failure refusal;
    const auto permit = forwarding_permit::ask(routing_->host(), *request_, path_.by, node, refusal);
    if (!permit) {
        p.asked = false;
        p.held_back = true;
        p.failure = std::move(refusal);
        return;
    }
    place_.from()->join(*permit, path_, weak_from_this(),
                        [this, weak = weak_from_this(), node](topic* t, std::string_view last,
                                                              const std::optional<update_mark>& mark,
                                                              const protocol::failure& why) {
                            if (const auto self = weak.lock(); self && !closed_) {
                                on_result(node, t, last, mark, why);
                            }
                        });
}

void all_binding::on_result(const std::string& node, topic* t, std::string_view last,
                            const std::optional<update_mark>& mark, const protocol::failure& why) {
    auto& p = parts_[node];
    p.asked = false;
    if (t != nullptr) {
        if (call_ && call_->hold_more(last.size())) {
            p.result = last.empty() ? std::string_view{"{}"} : last;
            p.mark = mark;
        } else if (call_) {
            p.failure = protocol::failure{.code = errc::busy,
                                          .message = node + ": no memory is left for its last value (limits.memory)"};
        }
        p.bound = true;
        place_.take_part(*t, wanted_);
    } else {
        p.failure = why;
    }
    reply_when_complete();
}

void all_binding::reply_when_complete() {
    const bool whole = std::none_of(parts_.begin(), parts_.end(), [](const auto& entry) { return entry.second.asked; });
    if (whole && !joining_) {
        answer();
    }
}

void all_binding::on_deadline(time_point now) {
    if (!begun_) {
        const auto self = shared_from_this();
        bind_known(now);
    } else {
        answer();
    }
}

void all_binding::answer() {
    const auto c = std::exchange(call_, nullptr);
    if (!c) {
        return;
    }
    const auto self = shared_from_this();
    routing_->host().deadlines.disarm(*this);
    aggregate_reply text{request_->wants_mark};
    for (auto& [node, p] : parts_) {
        text.add(node, p);
        p.result.reset(); // not needed for the rest of the binding
    }
    c->done(text.whole());
}

void all_binding::close(const all_binding* heir) {
    if (std::exchange(closed_, true)) {
        return;
    }
    const auto self = shared_from_this();
    routing_->host().deadlines.disarm(*this);
    for (const auto& [node, p] : std::exchange(parts_, {})) {
        if (heir != nullptr && heir->parts_.contains(node)) {
            continue;
        }
        if (node == routing_->host().name) {
            place_.leave_own_part(path_.text);
        } else {
            place_.leave_part(path_.key(node));
        }
    }
    if (const auto c = std::exchange(call_, nullptr)) {
        c->fail({.code = errc::cancelled, .message = "it was unbound"});
    }
}

} // namespace cles::core
