// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/group_keys.hpp"

#include <algorithm>
#include <array>

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

} // namespace cles::security
