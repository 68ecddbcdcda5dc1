// SPDX-License-Identifier: BSL-1.0
#include "shell/connections.hpp"

#include "core/request_checks.hpp"
#include "protocol/message.hpp"
#include "shell/engine.hpp"

#include <utility>

namespace cles::shell {

void connections::on_accepted(link_ptr arrived, bool counted) {
    if (engine_.stopped()) {
        arrived->close();
        return;
    }
    if (counted && !has_room(arrived->datagram() != 0)) {
        turn_away(std::move(arrived));
        return;
    }
    if (counted) {
        ++engine_.node().counts.links_accepted;
    }
    adopt(std::move(arrived), counted ? connection::origin::accepted : connection::origin::local);
}

bool connections::has_room(bool is_source) {
    const auto most = engine_.bounds().links;
    if (!is_source) {
        return accepted_ < most;
    }
    if (sources_ >= most) {
        drop_sources_at_rest();
    }
    return sources_ < most;
}

// All at once, so that many new sources do not cost a search each.
void connections::drop_sources_at_rest() {
    for (const auto& c : all()) {
        if (c->is_source() && c->at_rest()) {
            c->abandon("others needed the room");
        }
    }
}

void connections::turn_away(link_ptr arrived) {
    ++engine_.node().counts.links_refused;
    if (arrived->datagram() != 0) { // what is refused comes next, and says to whom
        adopt(std::move(arrived), connection::origin::refused);
        return;
    }
    protocol::append_failure(arrived->output(), core::no_room_for_links(engine_.node()));
    arrived->output().push_back('\n');
    arrived->flush();
    arrived->close();
}

std::shared_ptr<connection> connections::adopt(link_ptr made, connection::origin from) {
    auto c = std::make_shared<connection>(engine_.shared_from_this(), std::move(made), from);
    open_.emplace(c.get(), c);
    if (from == connection::origin::accepted) {
        ++(c->is_source() ? sources_ : accepted_);
    }
    ++engine_.node().counts.links_open;
    if (engine_.closing()) {
        begin_nothing(*c);
    }
    c->start();
    return c;
}

void connections::begin_nothing() {
    for (const auto& [key, c] : open_) {
        begin_nothing(*c);
    }
}

// In this process it is asked by its own handlers too, which are to come to their end.
void connections::begin_nothing(connection& c) {
    if (c.from() != connection::origin::local) {
        c.session().serving().begin_nothing();
    }
}

bool connections::forget(connection& c, std::uint64_t received, std::uint64_t sent) {
    if (open_.erase(&c) == 0) {
        return false;
    }
    if (c.from() == connection::origin::accepted) {
        --(c.datagram() != 0 ? sources_ : accepted_);
    }
    auto& counts = engine_.node().counts;
    --counts.links_open;
    ++counts.links_lost;
    counts.bytes_received += received;
    counts.bytes_sent += sent;
    return true;
}

bool connections::cancel(std::uint64_t id) {
    for (const auto& [key, c] : open_) {
        const auto held = c;
        if (held->session().asking().cancel(id)) {
            return true;
        }
    }
    return false;
}

std::vector<std::shared_ptr<connection>> connections::all() const {
    std::vector<std::shared_ptr<connection>> result;
    result.reserve(open_.size());
    for (const auto& [key, c] : open_) {
        result.push_back(c);
    }
    return result;
}

} // namespace cles::shell
