// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/sealed_datagrams.hpp"

#include <utility>

namespace cles::security {
namespace {

bool is_announcement(std::string_view line) {
    constexpr std::string_view start = "UPDATE ";
    if (!line.starts_with(start)) {
        return false;
    }
    line.remove_prefix(start.size());
    return line.substr(0, line.find(' ')).ends_with(":cles");
}

} // namespace

sealed_datagrams::sealed_datagrams(fleet& of, entropy& random)
    : fleet_(of), sender_(of, random), receiver_(of, sender_, random), sessions_(of, *this, random), rosters_(of) {}

void sealed_datagrams::begin(std::uint32_t epoch, const core::clock& time, observer by) {
    epoch_ = epoch;
    time_ = &time;
    observer_ = std::move(by);
}

void sealed_datagrams::end() {
    observer_ = {};
    time_ = nullptr;
}

std::uint32_t sealed_datagrams::add(datagram_socket& socket) {
    sockets_.emplace(++last_number_, &socket);
    return last_number_;
}

void sealed_datagrams::remove(std::uint32_t number) { sockets_.erase(number); }

datagram_socket* sealed_datagrams::find(std::uint32_t number) const {
    const auto found = sockets_.find(number);
    return found == sockets_.end() ? nullptr : found->second;
}

void sealed_datagrams::report_due() {
    if (const auto next = sessions_.next_deadline(); next && observer_.due) {
        observer_.due(*next);
    }
}

void sealed_datagrams::receive(const datagram_path& from, bytes_view datagram) {
    if (time_ == nullptr) {
        return;
    }
    try {
        sessions_.receive(from, datagram, now());
    } catch (...) { // of what a line has set off
        report_due();
        throw;
    }
    report_due();
}

bool sealed_datagrams::send(const datagram_source& to, std::string_view line) {
    if (time_ == nullptr) {
        return false;
    }
    const bool taken = sessions_.send(to, line, now());
    report_due();
    return taken;
}

bool sealed_datagrams::contact(const datagram_source& with) {
    if (time_ == nullptr) {
        return false;
    }
    const bool known = sessions_.contact(with, now());
    report_due();
    return known;
}

void sealed_datagrams::check_peer(const datagram_source& with, time_point since) {
    if (time_ != nullptr) {
        sessions_.check_peer(with, since, now());
        report_due();
    }
}

group_receiver::result sealed_datagrams::open_group(const datagram_path& from, bytes_view datagram) {
    if (time_ == nullptr) {
        return {};
    }
    auto found = receiver_.open(from, datagram, now());
    if (found.what == group_receiver::verdict::dropped && !is_own(datagram)) {
        ++group_unopened_;
    }
    if (found.contact) {
        contact(*found.contact);
    }
    if (found.outdated) { // not always the source of this datagram
        if (auto* const at = find(found.outdated->path.local)) {
            at->on_outdated(*found.outdated);
        }
    }
    return found;
}

// The group returns what this node has sent.
bool sealed_datagrams::is_own(bytes_view datagram) {
    const auto head = read_head(datagram);
    const auto* const self = fleet_.self();
    return head && self != nullptr && head->sender == self->number && head->salt == sender_.salt();
}

void sealed_datagrams::on_time(time_point now) {
    sessions_.on_time(now);
    report_due();
}

// -- datagram_sink -------------------------------------------------------------------------------------------------

void sealed_datagrams::send(const datagram_path& to, bytes_view datagram) {
    if (auto* const by = find(to.local)) {
        by->send_sealed(to, datagram);
    }
}

node_statement sealed_datagrams::statement() {
    return {.roster = fleet_.in_force().version(),
            .epoch = epoch_,
            .salt = sender_.salt(),
            .counter = sender_.next_counter()};
}

void sealed_datagrams::established(const datagram_source& with, const node_statement& stated, bool) {
    receiver_.learn(with.member, stated);
    rosters_.learn(with.member, stated.roster);
    if (observer_.stated) {
        observer_.stated(with.member, stated.roster);
    }
    if (auto* const at = find(with.path.local)) {
        at->on_established(with, stated.epoch);
    }
}

void sealed_datagrams::opened(const datagram_source& from, std::uint32_t epoch, std::string_view line) {
    auto* const at = find(from.path.local);
    if (at == nullptr) {
        return;
    }
    if (!is_announcement(line)) {
        at->on_opened(from, epoch, line);
    } else if (rosters_.has(from.member)) { // else it says nothing: the group brings it
        at->on_announcement(from, line);
    }
}

void sealed_datagrams::gave_up(const datagram_source& with, bool lost) {
    if (auto* const at = find(with.path.local)) {
        at->on_gave_up(with, lost);
    }
}

void sealed_datagrams::refused(const datagram_source& by, hello_refusal why) {
    if (observer_.refused) {
        observer_.refused(by, why);
    }
}

bool sealed_datagrams::holds(const datagram_source& which) const {
    const auto* const at = find(which.path.local);
    return at != nullptr && at->holds(which);
}

} // namespace cles::security
