// SPDX-License-Identifier: BSL-1.0
#include "node/membership/announcer.hpp"

#include <algorithm>

namespace cles::core {

std::chrono::milliseconds announcer::interval_among(std::size_t others) noexcept {
    return std::clamp(per_node * static_cast<std::int64_t>(others + 1), shortest, longest);
}

void announcer::start(time_point now) {
    started_ = true;
    last_ = now - pause;
    announce_by(now);
}

void announcer::expedite(time_point now) { announce_by(now); }

// All known nodes answer the same solicitation, so the delay grows with their number.
void announcer::solicited(time_point now) {
    const auto all = static_cast<std::int64_t>(owner_.others()) + 1;
    const auto within = std::min<std::chrono::milliseconds>(answer_within, per_node * all);
    announce_by(now + jitter_.quarter_of(within * 4));
}

void announcer::stop() noexcept {
    started_ = false;
    deadlines_.disarm(*this);
}

// An announcement is always complete, so an earlier one also replaces a later one.
void announcer::announce_by(time_point due) {
    due = std::max(due, last_ + pause);
    if (started_ && (!armed() || due < this->due())) {
        deadlines_.arm(*this, due);
    }
}

void announcer::on_deadline(time_point now) {
    const auto interval = interval_among(owner_.others());
    last_ = now;
    deadlines_.arm(*this, now + interval - jitter_.quarter_of(interval));
    owner_.announce(interval);
}

} // namespace cles::core
