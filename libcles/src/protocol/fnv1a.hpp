// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string_view>

namespace cles::protocol {

/// FNV-1a (Fowler, Noll, Vo), 64 bits: the hash of no text.
inline constexpr std::uint64_t fnv1a_basis = 0xcbf29ce484222325U;

/// The hash of a longer text: of what was hashed before, followed by `text`.
constexpr std::uint64_t fnv1a(std::string_view text, std::uint64_t before = fnv1a_basis) noexcept {
    constexpr std::uint64_t prime = 0x100000001b3U;
    for (const char c : text) {
        before = (before ^ static_cast<unsigned char>(c)) * prime;
    }
    return before;
}

} // namespace cles::protocol
