// SPDX-License-Identifier: BSL-1.0
#include "core/link_admission.hpp"

namespace cles::core {
namespace {

/// Keeps the better of two, where "better" is the earlier time.
class earliest {
  public:
    void offer(link_admission::guest& g, time_point at) noexcept {
        if (found == nullptr || at < at_) {
            found = &g;
            at_ = at;
        }
    }
    link_admission::guest* found = nullptr;

  private:
    time_point at_{};
};

} // namespace

bool link_admission::make_room(std::string_view address, time_point now) {
    if (guests_.size() < bounds_.links) {
        return true;
    }
    const auto usual = search(now);
    auto* chosen = usual.first;
    if (chosen == nullptr) {
        chosen = of_the_greediest(address);
    }
    if (chosen == nullptr) {
        chosen = usual.idle;
    }
    if (chosen == nullptr) {
        return false;
    }
    chosen->give_way();
    return guests_.size() < bounds_.links;
}

void link_admission::enter(guest& g, std::string_view address) {
    g.address_ = address;
    g.place_ = guests_.size();
    guests_.push_back(&g);
    ++per_address_[g.address_];
}

void link_admission::leave(guest& g) {
    auto* last = guests_.back();
    guests_[g.place_] = last;
    last->place_ = g.place_;
    guests_.pop_back();
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
    for (auto* g : guests_) {
        const auto& m = g->monitor();
        if (m.is_half_closed()) {
            half_closed.offer(*g, m.half_closed_at());
        } else if (!m.has_spoken()) {
            if (now - m.opened() >= time_to_speak) {
                silent.offer(*g, m.opened());
            }
        } else if (now - m.last_line() >= idle_for && g->at_rest()) {
            idle.offer(*g, m.last_line());
        }
    }
    auto* first = half_closed.found != nullptr ? half_closed.found : silent.found;
    if (first == nullptr && idle.found == nullptr) {
        search_again_ = now + search_pause;
    }
    return {first, idle.found};
}

link_admission::guest* link_admission::of_the_greediest(std::string_view newcomer) const {
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
    guest* newest = nullptr;
    for (auto* g : guests_) {
        if (g->address_ != greediest) {
            continue;
        }
        const auto& m = g->monitor();
        if (g->at_rest()) {
            idle.offer(*g, m.last_line());
        }
        if (newest == nullptr || m.opened() >= newest->monitor().opened()) {
            newest = g;
        }
    }
    return idle.found != nullptr ? idle.found : newest;
}

} // namespace cles::core
