// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

/// Bytes, as text and as integers.

namespace cles::security {

using bytes_view = std::span<const std::uint8_t>;

[[nodiscard]] inline bytes_view as_bytes(std::string_view text) noexcept {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

[[nodiscard]] inline std::string_view as_text(bytes_view bytes) noexcept {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Big-endian integers of a given number of bytes.
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
