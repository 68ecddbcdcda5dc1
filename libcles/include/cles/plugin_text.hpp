// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/plugin_abi.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string_view>

/// Text and structures of the plugin ABI. Not for applications.

namespace cles::detail {

inline cles_text abi_text(std::string_view text) noexcept { return {text.data(), text.size()}; }
inline std::string_view view_of(cles_text text) noexcept {
    return text.data == nullptr ? std::string_view{} : std::string_view{text.data, text.size};
}

/// The number of nodes that may forward a request; a structure without it has the default.
inline std::uint32_t abi_hops(std::uint32_t most) noexcept { return most == 0 ? CLES_NO_HOPS : most; }
inline std::uint32_t hops_from(std::uint32_t given) noexcept {
    constexpr std::uint32_t usual = 8;
    return given == 0 ? usual : given == CLES_NO_HOPS ? 0 : given;
}

/// Copies a structure that begins with its size; members that the other side does not know are zero.
template <class T>
T known_part(const T* given) noexcept {
    T out{};
    if (given != nullptr) {
        std::memcpy(&out, given, std::min<std::size_t>(given->size, sizeof(T)));
    }
    return out;
}

} // namespace cles::detail
