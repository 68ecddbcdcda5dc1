// SPDX-License-Identifier: BSL-1.0
#include "node/session/reflection_limit.hpp"

#include <algorithm>
#include <chrono>

namespace cles::core {

bool reflection_limit::admit(std::string_view address, std::size_t bytes, time_point now) {
    auto* b = find_or_make(address, now);
    if (b == nullptr) {
        return false;
    }
    fill(*b, now);
    if (b->room < static_cast<double>(bytes)) {
        return false;
    }
    b->room -= static_cast<double>(bytes);
    return true;
}

void reflection_limit::fill(bucket& b, time_point now) noexcept {
    const auto passed = std::chrono::duration<double>{now - b.at}.count();
    b.room = std::min(b.room + passed * static_cast<double>(bytes_per_second), static_cast<double>(at_once));
    b.at = now;
}

reflection_limit::bucket* reflection_limit::find_or_make(std::string_view address, time_point now) {
    if (const auto found = buckets_.find(address); found != buckets_.end()) {
        return &found->second;
    }
    if (buckets_.size() >= max_addresses) {
        forget_full(now);
        if (buckets_.size() >= max_addresses) {
            return nullptr; // too many addresses to track: the newest get nothing
        }
    }
    return &buckets_.emplace(std::string{address}, bucket{.at = now}).first->second;
}

// An address whose bucket is full needs no entry. Searched at most every 100 ms, so that a flood of forged addresses
// does not cost a search each.
void reflection_limit::forget_full(time_point now) {
    if (now - tidied_ < std::chrono::milliseconds{100}) {
        return;
    }
    tidied_ = now;
    boost::unordered::erase_if(buckets_, [now](auto& each) {
        fill(each.second, now);
        return each.second.room >= static_cast<double>(at_once);
    });
}

} // namespace cles::core
