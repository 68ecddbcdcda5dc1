// SPDX-License-Identifier: BSL-1.0
#include "core/link_monitor.hpp"

#include <algorithm>

namespace cles::core {
namespace {

constexpr std::chrono::milliseconds longest_wait = std::chrono::hours{24}; // no sum with the present overflows

std::chrono::milliseconds first_probe(const limits& bounds) {
    return std::clamp(bounds.probe, std::chrono::milliseconds{1}, longest_wait);
}

} // namespace

void link_monitor::expect_line() {
    if (bounds_.first_line.count() > 0) {
        deadlines_.arm(*this, opened_ + std::min(bounds_.first_line, longest_wait));
    }
}

void link_monitor::on_end(time_point now) {
    half_closed_ = true;
    half_closed_at_ = now;
    deadlines_.arm(*this, now + first_probe(bounds_));
}

void link_monitor::on_deadline(time_point now) {
    if (half_closed_) {
        // Armed first: the owner may find the link lost, and stop this.
        deadlines_.arm(*this, now + std::min<std::chrono::milliseconds>(3 * first_probe(bounds_), longest_pause));
        owner_.on_probe();
    } else {
        owner_.on_silence();
    }
}

} // namespace cles::core
