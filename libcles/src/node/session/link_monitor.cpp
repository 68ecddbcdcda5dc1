// SPDX-License-Identifier: BSL-1.0
#include "node/session/link_monitor.hpp"

#include <algorithm>

namespace cles::core {
namespace {

constexpr std::chrono::milliseconds max_wait = std::chrono::hours{24}; // no sum with the current time overflows

std::chrono::milliseconds first_probe(const limits& bounds) {
    return std::clamp(bounds.probe, std::chrono::milliseconds{1}, max_wait);
}

/// Keeps the candidate with the earliest time.
class earliest {
  public:
    void offer(link_monitor& m, time_point at) noexcept {
        if (found == nullptr || at < at_) {
            found = &m;
            at_ = at;
        }
    }
    link_monitor* found = nullptr;

  private:
    time_point at_{};
};

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
    const auto usual = search(now);
    auto* chosen = usual.first;
    if (chosen == nullptr) {
        chosen = link_of_largest_holder(address);
    }
    if (chosen == nullptr) {
        chosen = usual.idle;
    }
    if (chosen == nullptr) {
        return false;
    }
    chosen->owner_.evict();
    return links_.size() < bounds_.links;
}

void link_admission::enter(link_monitor& m, std::string_view address) {
    m.address_ = address;
    m.place_ = links_.size();
    links_.push_back(&m);
    ++per_address_[m.address_];
}

void link_admission::leave(link_monitor& m) {
    auto* last = links_.back();
    links_[m.place_] = last;
    last->place_ = m.place_;
    links_.pop_back();
    if (const auto found = per_address_.find(m.address_); --found->second == 0) {
        per_address_.erase(found);
    }
}

std::size_t link_admission::share() const noexcept {
    return bounds_.links_per_address != 0 ? bounds_.links_per_address : bounds_.links - bounds_.links / 4;
}

link_admission::candidates link_admission::search(time_point now) {
    if (now < search_again_) {
        return {};
    }
    earliest half_closed;
    earliest silent;
    earliest idle;
    for (auto* m : links_) {
        if (m->half_closed_at_) {
            half_closed.offer(*m, *m->half_closed_at_);
        } else if (!m->has_received_) {
            if (now - m->opened_ >= first_line_grace) {
                silent.offer(*m, m->opened_);
            }
        } else if (now - m->last_line_ >= idle_for && m->owner_.is_idle()) {
            idle.offer(*m, m->last_line_);
        }
    }
    auto* first = half_closed.found != nullptr ? half_closed.found : silent.found;
    if (first == nullptr && idle.found == nullptr) {
        search_again_ = now + search_pause;
    }
    return {first, idle.found};
}

link_monitor* link_admission::link_of_largest_holder(std::string_view newcomer) const {
    std::string_view greediest;
    auto most = share();
    for (const auto& [address, count] : per_address_) {
        if (count > most) {
            greediest = address;
            most = count;
        }
    }
    if (greediest.empty() || greediest == newcomer) {
        return nullptr;
    }
    earliest idle;
    link_monitor* newest = nullptr;
    for (auto* m : links_) {
        if (m->address_ != greediest) {
            continue;
        }
        if (m->owner_.is_idle()) {
            idle.offer(*m, m->last_line_);
        }
        if (newest == nullptr || m->opened_ >= newest->opened_) {
            newest = m;
        }
    }
    return idle.found != nullptr ? idle.found : newest;
}

} // namespace cles::core
