// SPDX-License-Identifier: BSL-1.0
#include "core/reflection_limit.hpp"

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
    if (buckets_.size() >= most_addresses) {
        forget_full(now);
        if (buckets_.size() >= most_addresses) {
            return nullptr; // more strangers at once than can be kept apart: those who come last get nothing
        }
    }
    return &buckets_.emplace(std::string{address}, bucket{.at = now}).first->second;
}

// An address whose bucket is full again is as one that was never heard of. Looked for at most every tenth of a second,
// so that a flood of forged addresses does not cost a search each.
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
