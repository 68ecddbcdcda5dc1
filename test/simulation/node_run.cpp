// SPDX-License-Identifier: BSL-1.0
#include "simulation/node_run.hpp"

#include "protocol/message.hpp"
#include "simulation/datagram_port.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {

node_run::node_run(network& net, unsigned host, unsigned run, core::node_setup setup)
    : place(net.time(), host, setup.name), net_(net), run_(run),
      node_(std::make_shared<core::node>(std::move(setup), *this, [this] { turns_.ask(); })) {}

node_run::~node_run() = default;

void node_run::start(bool strangers) {
    const auto self = shared_from_this();
    net_.listen({host(), stream_door}, self, bounds(), [this](link_ptr made) { on_accepted(std::move(made)); });
    door_ = std::make_shared<datagram_port>(net_, self, endpoint{host(), datagram_door}, strangers);
    door_->accept([this](link_ptr made) { on_accepted(std::move(made)); });
    door_->open();
}

// One run in two sends from where the one before it did.
void node_run::join_group(group_watch& judge) {
    constexpr unsigned first_port = 40'000;
    const auto port = std::make_shared<group_port>(net_, shared_from_this(), first_port + run_ / 2);
    seat_ = std::make_unique<group_seat>(*this, port, judge, *protocol::parse_epoch(node_->epoch));
    run([this] { seat_->start(); });
}

void node_run::crash() {
    watcher().saw(name(), "crashes");
    net_.close_doors(host());
    for (const auto& c : open_) {
        c->vanish();
    }
    seat_.reset();
}

// -- links ---------------------------------------------------------------------------------------------------------

void node_run::on_accepted(link_ptr made) {
    const bool is_source = made->datagram() != 0;
    if (has_room(is_source)) {
        adopt(std::move(made), connection::origin::accepted);
    } else if (is_source) {
        adopt(std::move(made), connection::origin::refused);
    } else {
        protocol::append_failure(made->output(),
                                 {.code = errc::busy, .message = name() + " has as many links as it may"});
        made->output().push_back('\n');
        made->flush();
        made->close();
    }
}

bool node_run::has_room(bool for_source) {
    const auto count = [&] {
        return static_cast<std::size_t>(std::count_if(open_.begin(), open_.end(), [&](const auto& c) {
            return c->from() == connection::origin::accepted && c->is_source() == for_source;
        }));
    };
    if (for_source && count() >= bounds().links) {
        for (const auto open = open_; const auto& c : open) {
            if (c->is_source() && c->at_rest()) {
                c->abandon("others needed the room");
            }
        }
    }
    return count() < bounds().links;
}

std::shared_ptr<connection> node_run::adopt(link_ptr made, connection::origin from) {
    auto c = std::make_shared<connection>(*this, std::move(made), from);
    open_.push_back(c);
    c->start();
    return c;
}

void node_run::forget(connection& c) {
    for (const auto& [where, r] : routes_) {
        r->drop(c);
    }
    std::erase_if(open_, [&](const auto& held) { return held.get() == &c; });
}

void node_run::post_turn() {
    later({}, [this] { turns_.turn(); });
}

// -- time ----------------------------------------------------------------------------------------------------------

// The timer goes off, if it is due by now; `follow_deadlines` comes next.
void node_run::after_jump() {
    ++timer_;
    set_for_.reset();
}

void node_run::follow_deadlines() {
    const auto next = node_->deadlines.next();
    if (!next || (set_for_ && *set_for_ <= *next)) {
        return;
    }
    set_for_ = next;
    absence_.expect(*next, now());
    constexpr std::chrono::milliseconds too_late{20};
    const auto off = fault() == planted::timer_late ? *next + too_late : *next;
    at(off, [this, mine = ++timer_] {
        if (mine == timer_) {
            set_for_.reset();
            if (absence_.ended(now()) && fault() != planted::excuse_forgotten) {
                node_->others.excuse(now());
            }
            node_->deadlines.expire(now());
        }
    });
}

// -- asking --------------------------------------------------------------------------------------------------------

route& node_run::route_to(unsigned to, carrier by) {
    auto& made = routes_[{to, by}];
    if (!made) {
        made = std::make_unique<route>(*this, to, by);
    }
    return *made;
}

std::uint64_t node_run::ask(unsigned to, carrier by, route::request r, detail::pending_ptr operation,
                            core::outbound::progress_function progress) {
    r.id = draw_id();
    turns_.let([&] { route_to(to, by).send(r, std::move(operation), std::move(progress)); });
    return r.id;
}

void node_run::cancel(std::uint64_t id) {
    for (const auto& [where, r] : routes_) {
        if (r->cancel(id)) {
            return;
        }
    }
    const auto open = open_;
    for (const auto& c : open) {
        if (c->session().asking().cancel(id)) {
            return;
        }
    }
}

void node_run::forget_waiting(const core::feed_machine& feed) {
    for (const auto& [where, r] : routes_) {
        r->forget(feed);
    }
}

// -- judging -------------------------------------------------------------------------------------------------------

void node_run::check_bounds() {
    const auto& b = bounds();
    constexpr std::size_t largest_datagram = 1500;
    if (node_->remembered.used > b.remembered + b.running * largest_datagram) {
        complain(rule::bounded, "remembers " + std::to_string(node_->remembered.used) + " bytes of datagrams");
    }
    if (node_->counts.handlers_running > b.running) {
        complain(rule::bounded, "runs " + std::to_string(node_->counts.handlers_running) + " handlers");
    }
    if (node_->others.size() > b.peers || node_->counts.group_leases > b.group_leases) {
        complain(rule::bounded, "knows " + std::to_string(node_->others.size()) + " nodes and holds " +
                                    std::to_string(node_->counts.group_leases) + " leases of the group");
    }
    if (seat_ && seat_->unsent() > group_port::most_waiting) {
        complain(rule::bounded, "holds " + std::to_string(seat_->unsent()) + " bytes for the group");
    }
    // What may be unread, what one turn answers beyond it, what runs, and updates, which come in pieces. What the node
    // asks by itself nobody bounds.
    constexpr std::size_t piece = 65536;
    constexpr std::size_t lines_per_write = 32;
    const auto longest = std::min<std::size_t>(b.line, 4096);
    const auto most_unsent = b.unread + (lines_per_write + b.in_flight) * longest + 2 * piece;
    for (const auto& c : open_) {
        if (c->from() == connection::origin::accepted && c->unsent() > most_unsent) {
            complain(rule::bounded, "holds " + std::to_string(c->unsent()) + " bytes for a link");
        }
        if (c->session().serving().bindings() > b.bindings) {
            complain(rule::bounded, "holds " + std::to_string(c->session().serving().bindings()) + " bindings");
        }
        if (c->session().serving().in_flight() > b.in_flight + b.waiting / 2) {
            complain(rule::bounded, "has " + std::to_string(c->session().serving().in_flight()) + " in flight");
        }
    }
}

void node_run::check_rest() {
    const auto expect_none = [&](std::size_t count, const char* what) {
        if (count != 0) {
            complain(rule::at_rest, std::to_string(count) + " " + what);
        }
    };
    expect_none(node_->deadlines.size(), "deadlines");
    expect_none(node_->remembered.used, "bytes remembered");
    expect_none(node_->counts.handlers_running, "handlers that run");
    expect_none(node_->others.size(), "nodes that are known though all are silent");
    expect_none(node_->counts.group_leases, "leases of the group");
    expect_none(seat_ ? seat_->unsent() : 0, "bytes that wait for the group");
    for (const auto& c : open_) {
        expect_none(c->is_source() ? 1 : 0, "source that is kept");
        expect_none(c->session().serving().in_flight(), "requests in flight");
        expect_none(c->session().serving().bindings(), "bindings");
        expect_none(c->session().asking().in_flight(), "requests that wait for an answer");
        expect_none(c->at_rest() ? 0 : 1, "link that is not at rest");
    }
    for (const auto& [where, r] : routes_) {
        expect_none(r->idle() ? 0 : 1, "route that is not idle");
    }
    expect_none(node_->published.take_waiters().size(), "publications that wait");
}

} // namespace cles::simulation
