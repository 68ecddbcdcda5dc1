// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/secret.hpp"

#include <cstdint>
#include <string_view>

/// Bytes as text, and text as bytes.

namespace cles::security {

[[nodiscard]] inline bytes_view as_bytes(std::string_view text) noexcept {
    return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

[[nodiscard]] inline std::string_view as_text(bytes_view bytes) noexcept {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

} // namespace cles::security
