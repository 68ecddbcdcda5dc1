// SPDX-License-Identifier: BSL-1.0
#include "core/announcer.hpp"

#include <algorithm>

namespace cles::core {

std::chrono::milliseconds announcer::interval_among(std::size_t others) noexcept {
    return std::clamp(per_node * static_cast<std::int64_t>(others + 1), shortest, longest);
}

void announcer::start(time_point now) {
    started_ = true;
    last_ = now - pause;
    by(now);
}

void announcer::hurry(time_point now) { by(now); }

// All who are known answer the same question, so each waits the longer the more they are.
void announcer::solicited(time_point now) {
    const auto all = static_cast<std::int64_t>(owner_.others()) + 1;
    const auto within = std::min<std::chrono::milliseconds>(answer_within, per_node * all);
    by(now + jitter_.quarter_of(within * 4));
}

void announcer::stop() noexcept {
    started_ = false;
    deadlines_.disarm(*this);
}

// One announcement says it all, so that what comes sooner answers for what would come later.
void announcer::by(time_point due) {
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
