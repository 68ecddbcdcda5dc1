// SPDX-License-Identifier: BSL-1.0
#include "core/feed_queue.hpp"

#include <algorithm>

namespace cles::core {

void feed_queue::forget(const entry& e) noexcept {
    if (is_value(e)) {
        --values_;
        bytes_ -= e.body.size();
    } else if (is_news(e)) {
        --news_;
    }
}

// A gap that stands before the value goes with it: one gap tells of both. A value as it stood at the BIND is no update,
// and none is missed with it: what the publisher has sent since stands behind it.
void feed_queue::shed_oldest_value() {
    for (auto e = entries_.begin(); e != entries_.end();) {
        if (is_news(*e)) {
            ++e;
            continue;
        }
        const bool found = is_value(*e);
        shed_ += e->kind == feed_event::update ? 1 : e->missed;
        forget(*e);
        e = entries_.erase(e);
        if (found) {
            return;
        }
    }
}

void feed_queue::shed_oldest_news() {
    const auto oldest = std::find_if(entries_.begin(), entries_.end(), is_news);
    forget(*oldest);
    entries_.erase(oldest);
}

void feed_queue::push(const detail::raw_event& event) {
    constexpr std::size_t most_news = 16;
    entries_.push_back({event.kind, std::string{event.body}, std::string{event.publisher}, event.seq, event.missed,
                        std::string{event.text}});
    if (is_value(entries_.back())) {
        ++values_;
        bytes_ += event.body.size();
    } else if (is_news(entries_.back()) && ++news_ > most_news) {
        shed_oldest_news();
    }
    while (values_ > most_values_ || (bytes_ > most_bytes_ && values_ > 1)) {
        shed_oldest_value();
    }
}

} // namespace cles::core
