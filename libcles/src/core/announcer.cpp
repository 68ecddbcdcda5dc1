// SPDX-License-Identifier: BSL-1.0
#include "core/announcer.hpp"

#include <algorithm>

namespace cles::core {

void announcer::start(time_point now) {
    started_ = true;
    last_ = now - pause;
    by(now);
}

void announcer::hurry(time_point now) { by(now); }

void announcer::solicited(time_point now) { by(now + jitter_.quarter_of(answer_within * 4)); }

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
    const auto interval = std::clamp(per_node * static_cast<std::int64_t>(owner_.others() + 1), shortest, longest);
    last_ = now;
    deadlines_.arm(*this, now + interval - jitter_.quarter_of(interval));
    owner_.announce(interval);
}

} // namespace cles::core
