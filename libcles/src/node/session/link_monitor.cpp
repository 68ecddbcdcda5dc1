// SPDX-License-Identifier: BSL-1.0
#include "node/session/link_monitor.hpp"

#include <algorithm>

namespace cles::core {
namespace {

constexpr std::chrono::milliseconds max_wait = std::chrono::hours{24}; // no sum with the current time overflows

std::chrono::milliseconds first_probe(const limits& bounds) {
    return std::clamp(bounds.probe, std::chrono::milliseconds{1}, max_wait);
}

/// The link with the earliest of these times; null if none has one.
template <class Time>
link_monitor* earliest(const std::vector<link_monitor*>& links, Time time_of) {
    link_monitor* found = nullptr;
    std::optional<time_point> first;
    for (auto* m : links) {
        if (const std::optional<time_point> at = time_of(*m); at && (!first || *at < *first)) {
            found = m;
            first = at;
        }
    }
    return found;
}

} // namespace

// -- one link ------------------------------------------------------------------------------------------------------

void link_monitor::expect_line() {
    if (bounds_.first_line.count() > 0) {
        deadlines_.arm(*this, opened_ + std::min(bounds_.first_line, max_wait));
    }
}

void link_monitor::expect_datagrams() {
    is_source_ = true;
    deadlines_.arm(*this, opened_ + quiet);
}

void link_monitor::on_end(time_point now) {
    half_closed_at_ = now;
    deadlines_.arm(*this, now + first_probe(bounds_));
}

void link_monitor::on_deadline(time_point now) {
    if (is_source_ && now - last_line_ < quiet) {
        deadlines_.arm(*this, last_line_ + quiet);
    } else if (is_source_ && !owner_.is_idle()) {
        deadlines_.arm(*this, now + quiet);
    } else if (is_half_closed()) {
        // Armed first: the owner may find the link lost, and call `stop`.
        deadlines_.arm(*this, now + std::min<std::chrono::milliseconds>(3 * first_probe(bounds_), max_pause));
        owner_.on_probe();
    } else {
        owner_.on_silence();
    }
}

// -- all links -----------------------------------------------------------------------------------------------------

bool link_admission::ensure_capacity(std::string_view address, time_point now) {
    if (links_.size() < bounds_.links) {
        return true;
    }
    auto* const chosen = choose(address, now);
    if (chosen == nullptr) {
        return false;
    }
    chosen->owner_.evict();
    return links_.size() < bounds_.links;
}

link_monitor* link_admission::choose(std::string_view newcomer, time_point now) {
    auto* const stranger = strangers_.first_to_yield();
    if (stranger != nullptr && strangers_.held_by(stranger->address_) > strangers_.held_by(newcomer)) {
        return stranger;
    }
    const auto usual = search(now);
    if (usual.half_closed != nullptr) {
        return usual.half_closed;
    }
    auto* const oldest = strangers_.oldest();
    if (oldest != nullptr && now - oldest->opened_ >= first_line_grace) {
        return oldest;
    }
    auto* const greedy = link_of_largest_holder(newcomer);
    return greedy != nullptr ? greedy : usual.idle;
}

void link_admission::enter(link_monitor& m, std::string_view address) {
    m.address_ = address;
    m.place_ = links_.size();
    links_.push_back(&m);
    ++per_address_[m.address_];
    if (!m.has_received_) {
        m.stranger_ = strangers_.take(address, m);
    }
}

void link_admission::leave(link_monitor& m) {
    m.stranger_.release();
    auto* last = links_.back();
    links_[m.place_] = last;
    last->place_ = m.place_;
    links_.pop_back();
    if (const auto found = per_address_.find(m.address_); --found->second == 0) {
        per_address_.erase(found);
    }
}

link_admission::candidates link_admission::search(time_point now) {
    if (now < search_again_) {
        return {};
    }
    auto* const half_closed = earliest(links_, [](const link_monitor& m) { return m.half_closed_at_; });
    auto* idle = earliest(links_, [now](const link_monitor& m) {
        return m.has_received_ && now - m.last_line_ >= idle_for && m.owner_.is_idle() ? std::optional{m.last_line_}
                                                                                       : std::nullopt;
    });
    if (half_closed == nullptr && idle == nullptr) {
        search_again_ = now + search_pause;
    }
    return {half_closed, idle};
}

link_monitor* link_admission::link_of_largest_holder(std::string_view newcomer) const {
    const auto share = bounds_.links_per_address != 0 ? bounds_.links_per_address : bounds_.links - bounds_.links / 4;
    const auto largest = std::max_element(per_address_.begin(), per_address_.end(),
                                          [](const auto& a, const auto& b) { return a.second < b.second; });
    if (largest == per_address_.end() || largest->second <= share || largest->first == newcomer) {
        return nullptr;
    }
    const std::string_view greediest = largest->first;
    if (auto* idle = earliest(links_, [greediest](const link_monitor& m) {
            return m.address_ == greediest && m.owner_.is_idle() ? std::optional{m.last_line_} : std::nullopt;
        })) {
        return idle;
    }
    link_monitor* newest = nullptr;
    for (auto* m : links_) {
        if (m->address_ == greediest && (newest == nullptr || m->opened_ >= newest->opened_)) {
            newest = m;
        }
    }
    return newest;
}

} // namespace cles::core
