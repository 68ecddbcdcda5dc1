// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/group_keys.hpp"

#include "security/fleet/roster.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace cles::security {
namespace {

using sealed_group_keys = std::array<std::uint8_t, 2 * group_key_size + sealed_overhead>;

} // namespace

group_keys group_keys::random() {
    return {.current = secret_bytes::random(group_key_size), .next = secret_bytes::random(group_key_size)};
}

std::string seal_group_keys(const group_keys& keys, const agreement_key& receiver) {
    secret_bytes both{2 * group_key_size};
    std::ranges::copy(keys.current.view(), both.data());
    std::ranges::copy(keys.next.view(), both.data() + group_key_size);
    return to_base64url(seal_box(receiver, both.view()));
}

bool is_sealed_group_keys(std::string_view text) {
    sealed_group_keys box{};
    return read_base64url(text, box);
}

group_keys open_group_keys(std::string_view sealed, const signing_key& receiver) {
    sealed_group_keys box{};
    if (!read_base64url(sealed, box)) {
        throw security_error{"the group keys are malformed"};
    }
    const auto both = receiver.open_box(box);
    if (both.size() != 2 * group_key_size) {
        throw security_error{"the group keys are sealed for another key"};
    }
    return {.current = secret_bytes{both.view().first(group_key_size)},
            .next = secret_bytes{both.view().last(group_key_size)}};
}

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
