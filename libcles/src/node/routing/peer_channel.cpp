// SPDX-License-Identifier: BSL-1.0
#include "node/routing/peer_channel.hpp"

#include "node/local_node.hpp"
#include "node/publish/feed_machine.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

peer_channel::peer_channel(std::shared_ptr<local_node> host, url where)
    : host_(std::move(host)), where_(std::move(where)), address_(to_string(*where_)) {}

peer_channel::peer_channel(std::shared_ptr<local_node> host, std::string_view node)
    : host_(std::move(host)), address_(node) {}

std::shared_ptr<connection> peer_channel::usable() const {
    for (const auto& c : links_) {
        if (c->usable()) {
            return c;
        }
    }
    return nullptr;
}

std::shared_ptr<connection> peer_channel::free_for(const core::feed_machine& feed) const {
    for (const auto& c : links_) {
        if (c->usable() && c->session().bound().admits(feed)) {
            return c;
        }
    }
    return nullptr;
}

void peer_channel::send(const protocol::outgoing_request& r, time_point deadline, time_point now,
                        detail::pending_ptr operation, outbound::progress_function progress) {
    if (const auto c = usable()) {
        c->session().asking().send(r, deadline, now, std::move(operation), std::move(progress));
        return;
    }
    constexpr std::size_t around = 512; // overhead besides the text, roughly
    core::memory_reservation held{host_->node().kept_requests};
    const auto bytes = r.size() + around;
    if (r.is_reserved()) {
        held.resize(bytes);
    } else if (!held.try_resize(bytes)) {
        host_->fail_later(std::move(operation), errc::busy,
                          "too much waits for a link to " + address_ + " or others (limits.memory)",
                          std::move(progress));
        return;
    }
    auto w = std::make_unique<waiting>(*this, r);
    w->memory = std::move(held);
    w->operation = std::move(operation);
    w->progress = std::move(progress);
    host_->deadlines().arm(*w, deadline);
    requests_.push_back(std::move(w));
    dial();
}

bool peer_channel::cancel(std::uint64_t id) {
    const auto found =
        std::find_if(requests_.begin(), requests_.end(), [id](const auto& w) { return w->request.id == id; });
    if (found == requests_.end()) {
        return false;
    }
    auto operation = std::move((*found)->operation);
    auto report = std::move((*found)->progress);
    requests_.erase(found);
    host_->completions().fail(std::move(operation), errc::cancelled, "the request was withdrawn", std::move(report));
    return true;
}

void peer_channel::waiting::on_deadline(time_point) {
    const auto& list = owner.requests_;
    const auto found = std::find_if(list.begin(), list.end(), [this](const auto& w) { return w.get() == this; });
    auto held = std::move(operation);
    auto report = std::move(progress);
    const auto message = "no link to " + owner.address_ + " came about in time";
    auto& completions = owner.host_->completions();
    owner.requests_.erase(found); // destroys this
    completions.fail(std::move(held), errc::deadline, message, std::move(report));
}

void peer_channel::connect(core::feed_machine& feed, ready_function ready) {
    if (const auto c = free_for(feed)) {
        ready(c, {}, {});
        return;
    }
    waiting_feeds_.push_back({&feed, std::move(ready)});
    dial();
}

void peer_channel::forget(const core::feed_machine& feed) {
    waiting_feeds_.remove_if([&](const waiting_feed& f) { return f.feed == &feed; });
}

void peer_channel::drop(const connection& c) {
    std::erase_if(links_, [&](const auto& held) { return held.get() == &c; });
}

void peer_channel::release() {
    for (const auto& c : std::vector{links_}) {
        if (c->usable() && c->is_idle()) {
            c->finish();
        }
    }
    std::erase_if(links_, [](const auto& c) { return !c->usable(); });
}

void peer_channel::dial() {
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

void peer_channel::on_dialled(boost::system::error_code code, link_ptr made) {
    const auto keep = shared_from_this();
    give_up_ = nullptr;
    if (code) {
        fail(code, "cannot connect to " + address_ + ": " + code.message());
    } else {
        const auto c = host_->connections().adopt(std::move(made), connection::origin::dialled);
        links_.push_back(c);
        serve_waiting(c);
    }
}

void peer_channel::serve_waiting(const std::shared_ptr<connection>& c) {
    const auto now = host_->now();
    for (auto requests = std::exchange(requests_, {}); !requests.empty(); requests.pop_front()) {
        auto& w = *requests.front();
        host_->deadlines().disarm(w);
        w.memory.resize(0); // the link accounts for it now
        c->session().asking().send(w.request, w.due(), now, std::move(w.operation), std::move(w.progress));
    }
    for (auto feeds = std::exchange(waiting_feeds_, {}); !feeds.empty(); feeds.pop_front()) {
        auto& next = feeds.front();
        if (const auto free = free_for(*next.feed)) {
            next.ready(free, {}, {});
        } else {
            waiting_feeds_.push_back(std::move(next));
        }
    }
    if (!waiting_feeds_.empty()) {
        dial();
    }
}

void peer_channel::hand_over(peer_channel& channel) {
    const auto now = host_->now();
    for (auto requests = std::exchange(requests_, {}); !requests.empty(); requests.pop_front()) {
        auto& w = *requests.front();
        host_->deadlines().disarm(w);
        w.memory.resize(0);
        channel.send(w.request, w.due(), now, std::move(w.operation), std::move(w.progress));
    }
    for (auto feeds = std::exchange(waiting_feeds_, {}); !feeds.empty(); feeds.pop_front()) {
        channel.connect(*feeds.front().feed, std::move(feeds.front().ready));
    }
}

void peer_channel::fail(boost::system::error_code code, std::string_view message) {
    auto requests = std::exchange(requests_, {});
    auto feeds = std::exchange(waiting_feeds_, {});
    for (const auto& w : requests) {
        host_->deadlines().disarm(*w);
    }
    for (const auto& w : requests) {
        host_->completions().fail(std::move(w->operation), code, message, std::move(w->progress));
    }
    for (const auto& f : feeds) {
        f.ready(nullptr, code, message);
    }
}

void peer_channel::stop() {
    if (const auto give_up = std::exchange(give_up_, nullptr)) {
        give_up();
    }
    waiting_feeds_.clear();
    links_.clear();
    for (const auto& w : std::exchange(requests_, {})) {
        host_->fail_later(std::move(w->operation), errc::stopped, "the service has been stopped",
                          std::move(w->progress));
    }
}

} // namespace cles::core
