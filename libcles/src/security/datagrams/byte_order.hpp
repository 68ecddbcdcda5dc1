// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>

/// Big-endian integers of a given number of bytes.

namespace cles::security {

template <std::size_t Bytes>
[[nodiscard]] constexpr std::uint64_t load_big(const std::uint8_t* from) noexcept {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < Bytes; ++i) {
        value = value << 8U | from[i];
    }
    return value;
}

template <std::size_t Bytes>
constexpr void store_big(std::uint64_t value, std::uint8_t* to) noexcept {
    for (std::size_t i = Bytes; i-- > 0; value >>= 8U) {
        to[i] = static_cast<std::uint8_t>(value);
    }
}

} // namespace cles::security
