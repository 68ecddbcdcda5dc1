// SPDX-License-Identifier: BSL-1.0
#include "simulation/route.hpp"

#include "simulation/datagram_port.hpp"
#include "simulation/node_run.hpp"
#include "simulation/stream_half.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {

std::shared_ptr<connection> route::usable() const {
    const auto found = std::find_if(links_.begin(), links_.end(), [](const auto& c) { return c->usable(); });
    return found == links_.end() ? nullptr : *found;
}

std::shared_ptr<connection> route::free_for(const core::feed_machine& feed) const {
    const auto found = std::find_if(links_.begin(), links_.end(), [&](const auto& c) {
        return c->usable() && !c->session().bound().has(feed.target(), feed.path());
    });
    return found == links_.end() ? nullptr : *found;
}

void route::send(const request& r, detail::pending_ptr operation, core::outbound::progress_function progress) {
    if (const auto c = usable()) {
        c->session().asking().send({.verb = r.verb, .noun = r.noun, .id = r.id, .adverbs = r.adverbs, .body = r.body},
                                   r.deadline, node_.now(), std::move(operation), std::move(progress));
        return;
    }
    auto w = std::make_unique<waiting>(*this);
    w->verb = r.verb;
    w->noun = r.noun;
    w->body = r.body;
    w->adverbs = r.adverbs;
    w->id = r.id;
    w->deadline = r.deadline;
    w->operation = std::move(operation);
    w->progress = std::move(progress);
    node_.node()->deadlines.arm(*w, r.deadline);
    requests_.push_back(std::move(w));
    dial();
}

bool route::cancel(std::uint64_t id) {
    const auto found = std::find_if(requests_.begin(), requests_.end(), [id](const auto& w) { return w->id == id; });
    if (found == requests_.end()) {
        return false;
    }
    auto operation = std::move((*found)->operation);
    requests_.erase(found);
    operation.release()->fail(errc::cancelled, "the request was withdrawn");
    return true;
}

void route::waiting::on_deadline(time_point) {
    const auto& list = owner.requests_;
    const auto found = std::find_if(list.begin(), list.end(), [this](const auto& w) { return w.get() == this; });
    auto held = std::move(operation);
    owner.requests_.erase(found); // ends this
    held.release()->fail(errc::deadline, "no link came about in time");
}

void route::connect(core::feed_machine& feed, std::function<void(const std::shared_ptr<connection>&)> ready) {
    if (const auto c = free_for(feed)) {
        ready(c);
        return;
    }
    binders_.push_back({&feed, std::move(ready)});
    dial();
}

void route::forget(const core::feed_machine& feed) {
    binders_.remove_if([&](const binder& b) { return b.feed == &feed; });
}

void route::drop(const connection& c) {
    std::erase_if(links_, [&](const auto& held) { return held.get() == &c; });
}

void route::dial() {
    if (dialling_) {
        return;
    }
    dialling_ = true;
    if (by_ == carrier::stream) {
        node_.net().dial(node_.shared_from_this(), {to_, stream_door}, node_.bounds(),
                         [this](boost::system::error_code code, std::shared_ptr<stream_half> made) {
                             on_dialled(code, std::move(made));
                         });
        return;
    }
    node_.later({}, [this] {
        const auto home = node_.shared_from_this();
        const endpoint local{node_.host(), node_.net().free_port(node_.host())};
        const auto port = std::make_shared<datagram_port>(node_.net(), home, local, false);
        port->open();
        on_dialled({}, port->connect({to_, datagram_door}));
    });
}

void route::on_dialled(boost::system::error_code code, link_ptr made) {
    dialling_ = false;
    if (code) {
        fail_waiting(code);
    } else {
        const auto c = node_.adopt(std::move(made), connection::origin::dialled);
        links_.push_back(c);
        serve_waiting(c);
    }
}

void route::serve_waiting(const std::shared_ptr<connection>& c) {
    for (auto requests = std::exchange(requests_, {}); !requests.empty(); requests.pop_front()) {
        auto& w = *requests.front();
        node_.node()->deadlines.disarm(w);
        c->session().asking().send({.verb = w.verb, .noun = w.noun, .id = w.id, .adverbs = w.adverbs, .body = w.body},
                                   w.deadline, node_.now(), std::move(w.operation), std::move(w.progress));
    }
    for (auto binders = std::exchange(binders_, {}); !binders.empty(); binders.pop_front()) {
        auto& next = binders.front();
        if (const auto free = free_for(*next.feed)) {
            next.ready(free);
        } else {
            binders_.push_back(std::move(next));
        }
    }
    if (!binders_.empty()) {
        dial();
    }
}

void route::fail_waiting(boost::system::error_code code) {
    auto requests = std::exchange(requests_, {});
    auto binders = std::exchange(binders_, {});
    for (const auto& w : requests) {
        node_.node()->deadlines.disarm(*w);
    }
    for (const auto& w : requests) {
        w->operation.release()->fail(code, "cannot connect");
    }
    for (const auto& b : binders) {
        b.ready(nullptr);
    }
}

} // namespace cles::simulation
