// SPDX-License-Identifier: BSL-1.0
#include "shell/connections.hpp"

#include "core/ip_network.hpp"
#include "core/request_checks.hpp"
#include "core/teller.hpp"
#include "protocol/message.hpp"
#include "shell/local_node.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace cles::shell {
namespace {

// Whose share a link counts for: a host's, or a local user's.
std::string address_of(const identity& peer) {
    if (peer.uid) {
        return "user " + std::to_string(*peer.uid);
    }
    const auto host = core::host_of(peer);
    return host.empty() ? peer.transport : core::share_of_address(host);
}

// How many links are seen off at a time: each holds a descriptor for up to `limits::discard`.
std::size_t most_parting(const limits& bounds) { return std::max<std::size_t>(64, bounds.links / 4); }

} // namespace

/// The owner of a link that is refused: ignores what arrives, and waits until the link has closed.
class connections::refused final : public link_events {
  public:
    refused(std::weak_ptr<local_node> host, const link& which) noexcept : host_(std::move(host)), which_(which) {}
    void on_line(std::string_view) override {}
    void on_overlong(std::string_view) override {}
    void on_batch() override {}
    void on_end() override {}
    void on_room() override {}
    void on_lost(boost::system::error_code) override {
        if (const auto host = host_.lock()) {
            host->connections().seen_off(which_);
        }
    }

  private:
    std::weak_ptr<local_node> host_;
    const link& which_; // which owns this
};

void connections::start() { admission_.emplace(host_.bounds()); }

void connections::stop() {
    for (const auto& [key, parting] : std::exchange(parting_, {})) {
        parting->close();
    }
}

void connections::see_off(link_ptr parting) {
    parting->flush();
    if (parting->unsent() != 0 || parting_.size() >= most_parting(host_.bounds())) {
        parting->close(); // there is no room to wait for a peer that does not read
        return;
    }
    parting_.emplace(parting.get(), parting);
    parting->finish();
}

void connections::seen_off(const link& parting) { parting_.erase(&parting); }

void connections::on_accepted(link_ptr arrived, bool counted) {
    if (host_.stopped()) {
        arrived->close();
        return;
    }
    if (counted && !has_room(*arrived)) {
        turn_away(std::move(arrived));
        return;
    }
    if (counted) {
        ++host_.node().counts.links_accepted;
    }
    adopt(std::move(arrived), counted ? connection::origin::accepted : connection::origin::local);
}

bool connections::has_room(const link& arrived) {
    const auto most = host_.bounds().links;
    if (arrived.datagram() == 0) {
        return admission_->make_room(address_of(arrived.peer()), host_.now());
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
    ++host_.node().counts.links_refused;
    if (arrived->datagram() != 0) { // what is refused comes next, and says to whom
        adopt(std::move(arrived), connection::origin::refused);
        return;
    }
    protocol::append_failure(arrived->output(), core::no_room_for_links(host_.node()));
    arrived->output().push_back('\n');
    // The link is read until it closes: unread input would turn that into a reset, which takes the line away.
    arrived->start(std::make_shared<refused>(host_.weak_from_this(), *arrived));
    see_off(std::move(arrived));
}

std::shared_ptr<connection> connections::adopt(link_ptr made, connection::origin from) {
    const bool counted = from == connection::origin::accepted;
    const auto address = counted ? address_of(made->peer()) : std::string{};
    auto c = std::make_shared<connection>(host_.shared_from_this(), std::move(made), from, ++last_number_);
    open_.emplace(c->number(), c);
    if (counted) {
        if (c->datagram() != 0) {
            ++sources_;
        } else {
            admission_->enter(*c, address);
        }
    }
    ++host_.node().counts.links_open;
    if (from == connection::origin::dialled && c->datagram() == 0) {
        c->session().may_be_refused();
    }
    if (host_.closing()) {
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
    if (open_.erase(c.number()) == 0) {
        return false;
    }
    if (c.from() == connection::origin::accepted) {
        if (c.datagram() != 0) {
            --sources_;
        } else {
            admission_->leave(c);
        }
    }
    auto& counts = host_.node().counts;
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
