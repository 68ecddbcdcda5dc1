// SPDX-License-Identifier: BSL-1.0
#include "node/session/link_monitor.hpp"

#include <algorithm>

namespace cles::core {
namespace {

constexpr std::chrono::milliseconds max_wait = std::chrono::hours{24}; // no sum with the current time overflows

std::chrono::milliseconds first_probe(const limits& bounds) {
    return std::clamp(bounds.probe, std::chrono::milliseconds{1}, max_wait);
}

} // namespace

void link_monitor::expect_line() {
    if (bounds_.first_line.count() > 0) {
        deadlines_.arm(*this, opened_ + std::min(bounds_.first_line, max_wait));
    }
}

void link_monitor::on_end(time_point now) {
    half_closed_ = true;
    half_closed_at_ = now;
    deadlines_.arm(*this, now + first_probe(bounds_));
}

void link_monitor::on_deadline(time_point now) {
    if (half_closed_) {
        // Armed first: the owner may find the link lost, and call `stop`.
        deadlines_.arm(*this, now + std::min<std::chrono::milliseconds>(3 * first_probe(bounds_), max_pause));
        owner_.on_probe();
    } else {
        owner_.on_silence();
    }
}

} // namespace cles::core
