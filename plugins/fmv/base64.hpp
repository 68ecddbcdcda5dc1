// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace fmv {

/// Bytes as text that JSON can carry (RFC 4648, with padding): four characters for three bytes.
std::string to_base64(std::span<const std::uint8_t> bytes);

/// The bytes; none where the text is not exactly `size` of them.
std::optional<std::vector<std::uint8_t>> from_base64(std::string_view text, std::size_t size);

/// How many bytes the text stands for, if it is valid.
std::size_t base64_size(std::string_view text) noexcept;

} // namespace fmv
