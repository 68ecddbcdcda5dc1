// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/plugin_abi.h>

#include <algorithm>
#include <cstring>
#include <string_view>

/// Text and structures of the plugin ABI. Not for applications.

namespace cles::detail {

inline cles_text abi_text(std::string_view text) noexcept { return {text.data(), text.size()}; }
inline std::string_view view_of(cles_text text) noexcept {
    return text.data == nullptr ? std::string_view{} : std::string_view{text.data, text.size};
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
