// SPDX-License-Identifier: BSL-1.0
#include "output/log_queue.hpp"

#include <utility>

namespace tool {

void log_queue::add(std::string line) {
    if (!entries_.empty() && (entries_.size() >= most_lines || bytes_ + line.size() > most_bytes)) {
        ++dropped_;
        return;
    }
    bytes_ += line.size();
    entries_.push_back({.dropped = std::exchange(dropped_, 0), .line = std::move(line)});
}

std::optional<log_queue::entry> log_queue::take() {
    if (empty()) {
        return std::nullopt;
    }
    if (entries_.empty()) {
        return entry{.dropped = std::exchange(dropped_, 0)};
    }
    auto next = std::move(entries_.front());
    entries_.pop_front();
    bytes_ -= next.line.size();
    return next;
}

} // namespace tool
