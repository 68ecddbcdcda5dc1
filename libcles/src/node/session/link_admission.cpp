// SPDX-License-Identifier: BSL-1.0
#include "node/session/link_admission.hpp"

namespace cles::core {
namespace {

/// Keeps the candidate with the earliest time.
class earliest {
  public:
    void offer(link_admission::admitted_link& g, time_point at) noexcept {
        if (found == nullptr || at < at_) {
            found = &g;
            at_ = at;
        }
    }
    link_admission::admitted_link* found = nullptr;

  private:
    time_point at_{};
};

} // namespace

bool link_admission::make_room(std::string_view address, time_point now) {
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
    chosen->evict();
    return links_.size() < bounds_.links;
}

void link_admission::enter(admitted_link& g, std::string_view address) {
    g.address_ = address;
    g.place_ = links_.size();
    links_.push_back(&g);
    ++per_address_[g.address_];
}

void link_admission::leave(admitted_link& g) {
    auto* last = links_.back();
    links_[g.place_] = last;
    last->place_ = g.place_;
    links_.pop_back();
    if (const auto found = per_address_.find(g.address_); --found->second == 0) {
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
    for (auto* g : links_) {
        const auto& m = g->monitor();
        if (m.is_half_closed()) {
            half_closed.offer(*g, m.half_closed_at());
        } else if (!m.has_received()) {
            if (now - m.opened() >= first_line_grace) {
                silent.offer(*g, m.opened());
            }
        } else if (now - m.last_line() >= idle_for && g->is_idle()) {
            idle.offer(*g, m.last_line());
        }
    }
    auto* first = half_closed.found != nullptr ? half_closed.found : silent.found;
    if (first == nullptr && idle.found == nullptr) {
        search_again_ = now + search_pause;
    }
    return {first, idle.found};
}

link_admission::admitted_link* link_admission::link_of_largest_holder(std::string_view newcomer) const {
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
    admitted_link* newest = nullptr;
    for (auto* g : links_) {
        if (g->address_ != greediest) {
            continue;
        }
        const auto& m = g->monitor();
        if (g->is_idle()) {
            idle.offer(*g, m.last_line());
        }
        if (newest == nullptr || m.opened() >= newest->monitor().opened()) {
            newest = g;
        }
    }
    return idle.found != nullptr ? idle.found : newest;
}

} // namespace cles::core
