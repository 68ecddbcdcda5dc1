// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/datagram_peer.hpp"

#include <algorithm>
#include <utility>

namespace cles::security {

datagram_peer::datagram_peer(datagram_source source, std::uint64_t number, session_table& table)
    : source_(source), number_(number), table_(table) {}

datagram_peer::~datagram_peer() {
    for (const auto& session : sessions_) {
        table_.erase(session->agreed().own_index);
    }
}

datagram_session* datagram_peer::newest() const noexcept { return sessions_.empty() ? nullptr : sessions_[0].get(); }

datagram_session* datagram_peer::unconfirmed() const noexcept {
    const auto found = std::ranges::find_if(sessions_, [](const auto& s) { return !s->confirmed(); });
    return found == sessions_.end() ? nullptr : found->get();
}

datagram_peer::introduction datagram_peer::introduce(std::unique_ptr<datagram_session> made) {
    const auto& agreed = made->agreed();
    const bool restarted = epoch_ && *epoch_ != agreed.stated.epoch;
    if (restarted) {
        if (!sessions_.empty() && newest()->agreed().order > agreed.order) {
            return introduction::refused;
        }
        while (!sessions_.empty()) {
            drop(*sessions_.back());
        }
    }
    epoch_ = agreed.stated.epoch;
    table_[agreed.own_index] = {.peer = this, .session = made.get()};
    const auto at =
        std::ranges::find_if(sessions_, [&](const auto& other) { return other->agreed().order < agreed.order; });
    sessions_.insert(at, std::move(made));
    return restarted ? introduction::restarted : introduction::same_epoch;
}

void datagram_peer::drop_surplus() {
    constexpr int most = 2;
    int confirmed = 0;
    for (std::size_t i = 0; i < sessions_.size();) {
        if (sessions_[i]->confirmed() && ++confirmed > most) {
            drop(*sessions_[i]);
        } else {
            ++i;
        }
    }
}

void datagram_peer::drop(const datagram_session& session) {
    if (!session.confirmed()) {
        retry.stop();
    }
    table_.erase(session.agreed().own_index);
    sessions_.erase(std::ranges::find(sessions_, &session, [](const auto& s) { return s.get(); }));
}

void datagram_peer::drop_begun_until(time_point last) {
    while (!sessions_.empty() && sessions_.back()->agreed().begun <= last) {
        drop(*sessions_.back());
    }
}

std::optional<time_point> datagram_peer::oldest_begun() const noexcept {
    if (sessions_.empty()) {
        return {};
    }
    return sessions_.back()->agreed().begun;
}

} // namespace cles::security
