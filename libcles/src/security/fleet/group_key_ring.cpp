// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/group_key_ring.hpp"

#include <utility>

namespace cles::security {

void group_key_ring::adopt(const roster& in_force, group_keys keys) {
    current_ = in_force.generation();
    std::erase_if(keys_, [&](const auto& entry) { return entry.first < in_force.oldest() || entry.first >= current_; });
    keys_.insert_or_assign(current_, std::move(keys.current));
    keys_.insert_or_assign(current_ + 1, std::move(keys.next));
}

void group_key_ring::clear() noexcept {
    current_ = 0;
    keys_.clear();
}

const secret_bytes* group_key_ring::find(std::uint32_t generation) const {
    const auto found = keys_.find(generation);
    return found == keys_.end() ? nullptr : &found->second;
}

} // namespace cles::security
