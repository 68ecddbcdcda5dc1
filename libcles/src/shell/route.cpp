// SPDX-License-Identifier: BSL-1.0
#include "shell/route.hpp"

#include "core/feed_machine.hpp"
#include "shell/local_node.hpp"

#include <algorithm>
#include <utility>

namespace cles::shell {
namespace {

void put(connection& c, const route::request& r, detail::pending_ptr operation,
         core::outbound::progress_function progress) {
    c.session().asking().send(
        {.verb = r.verb, .noun = r.noun, .id = r.id, .urgent = r.urgent, .adverbs = r.adverbs, .body = r.body},
        r.deadline, r.begun, std::move(operation), std::move(progress));
}

} // namespace

route::route(std::shared_ptr<local_node> host, url where)
    : host_(std::move(host)), where_(std::move(where)), address_(to_string(*where_)) {}

route::route(std::shared_ptr<local_node> host, std::string_view node) : host_(std::move(host)), address_(node) {}

std::shared_ptr<connection> route::usable() const {
    for (const auto& c : links_) {
        if (c->usable()) {
            return c;
        }
    }
    return nullptr;
}

std::shared_ptr<connection> route::free_for(const core::feed_machine& feed) const {
    for (const auto& c : links_) {
        if (c->usable() && c->session().bound().admits(feed)) {
            return c;
        }
    }
    return nullptr;
}

void route::send(const request& r, detail::pending_ptr operation, core::outbound::progress_function progress) {
    if (const auto c = usable()) {
        put(*c, r, std::move(operation), std::move(progress));
        return;
    }
    constexpr std::size_t around = 512; // the text, about
    core::memory_reservation held{host_->node().kept_requests};
    const auto bytes = r.noun.size() + r.adverbs.size() + r.body.size() + around;
    if (r.noun.find(":cles") != std::string_view::npos) { // what keeps a network together
        held.resize(bytes);
    } else if (!held.try_resize(bytes)) {
        host_->fail_later(std::move(operation), errc::busy,
                          "too much waits for a link to " + address_ + " or others (limits.memory)",
                          std::move(progress));
        return;
    }
    auto w = std::make_unique<waiting>(*this);
    w->memory = std::move(held);
    w->verb = r.verb;
    w->noun = r.noun;
    w->adverbs = r.adverbs;
    w->body = r.body;
    w->id = r.id;
    w->urgent = r.urgent;
    w->deadline = r.deadline;
    w->operation = std::move(operation);
    w->progress = std::move(progress);
    host_->deadlines().arm(*w, r.deadline);
    requests_.push_back(std::move(w));
    dial();
}

bool route::cancel(std::uint64_t id) {
    const auto found = std::find_if(requests_.begin(), requests_.end(), [id](const auto& w) { return w->id == id; });
    if (found == requests_.end()) {
        return false;
    }
    auto operation = std::move((*found)->operation);
    auto report = std::move((*found)->progress);
    requests_.erase(found);
    host_->completions().fail(std::move(operation), errc::cancelled, "the request was withdrawn", std::move(report));
    return true;
}

void route::waiting::on_deadline(time_point) {
    const auto& list = owner.requests_;
    const auto found = std::find_if(list.begin(), list.end(), [this](const auto& w) { return w.get() == this; });
    auto held = std::move(operation);
    auto report = std::move(progress);
    const auto message = "no link to " + owner.address_ + " came about in time";
    auto& completions = owner.host_->completions();
    owner.requests_.erase(found); // ends this
    completions.fail(std::move(held), errc::deadline, message, std::move(report));
}

void route::connect(core::feed_machine& feed, ready_function ready) {
    if (const auto c = free_for(feed)) {
        ready(c, {}, {});
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

void route::release() {
    for (const auto& c : std::vector{links_}) {
        if (c->usable() && c->at_rest()) {
            c->finish();
        }
    }
    std::erase_if(links_, [](const auto& c) { return !c->usable(); });
}

void route::dial() {
    if (give_up_ || !where_) {
        return;
    }
    give_up_ = host_->environment().dial(*where_, host_->bounds(),
                                         [weak = weak_from_this()](boost::system::error_code code, link_ptr made) {
                                             if (const auto self = weak.lock()) {
                                                 self->on_dialled(code, std::move(made));
                                             } else if (made) {
                                                 made->close();
                                             }
                                         });
}

void route::on_dialled(boost::system::error_code code, link_ptr made) {
    const auto keep = shared_from_this();
    give_up_ = nullptr;
    if (code) {
        fail(code, "cannot connect to " + address_ + ": " + code.message());
    } else {
        const auto c = host_->connections().adopt(std::move(made), connection::origin::dialled);
        links_.push_back(c);
        serve_waiting(c);
    }
    host_->settle();
}

void route::serve_waiting(const std::shared_ptr<connection>& c) {
    const auto now = host_->now();
    for (auto requests = std::exchange(requests_, {}); !requests.empty(); requests.pop_front()) {
        auto& w = *requests.front();
        host_->deadlines().disarm(w);
        w.memory.resize(0); // the link counts it now
        put(*c, w.asked(now), std::move(w.operation), std::move(w.progress));
    }
    for (auto binders = std::exchange(binders_, {}); !binders.empty(); binders.pop_front()) {
        auto& next = binders.front();
        if (const auto free = free_for(*next.feed)) {
            next.ready(free, {}, {});
        } else {
            binders_.push_back(std::move(next));
        }
    }
    if (!binders_.empty()) {
        dial();
    }
}

void route::hand_over(route& way) {
    const auto now = host_->now();
    for (auto requests = std::exchange(requests_, {}); !requests.empty(); requests.pop_front()) {
        auto& w = *requests.front();
        host_->deadlines().disarm(w);
        w.memory.resize(0);
        way.send(w.asked(now), std::move(w.operation), std::move(w.progress));
    }
    for (auto binders = std::exchange(binders_, {}); !binders.empty(); binders.pop_front()) {
        way.connect(*binders.front().feed, std::move(binders.front().ready));
    }
}

void route::fail(boost::system::error_code code, std::string_view message) {
    auto requests = std::exchange(requests_, {});
    auto binders = std::exchange(binders_, {});
    for (const auto& w : requests) {
        host_->deadlines().disarm(*w);
    }
    for (const auto& w : requests) {
        host_->completions().fail(std::move(w->operation), code, message, std::move(w->progress));
    }
    for (const auto& b : binders) {
        b.ready(nullptr, code, message);
    }
}

void route::stop() {
    if (const auto give_up = std::exchange(give_up_, nullptr)) {
        give_up();
    }
    binders_.clear();
    links_.clear();
    for (const auto& w : std::exchange(requests_, {})) {
        host_->fail_later(std::move(w->operation), errc::stopped, "the service has been stopped",
                          std::move(w->progress));
    }
}

} // namespace cles::shell
