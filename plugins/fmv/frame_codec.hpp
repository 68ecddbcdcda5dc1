// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "image.hpp"

#include <optional>
#include <string>
#include <string_view>

namespace fmv {

/// Formats of a picture in a message, each in base64: `grey`, a byte for each pixel, and `jpeg`, if this program is
/// built with libjpeg-turbo.
[[nodiscard]] bool has_jpeg() noexcept;
/// `jpeg`, or `grey` without it.
inline const char* default_format() noexcept { return has_jpeg() ? "jpeg" : "grey"; }

/// \param format one that this program has \param quality of a JPEG, 1 to 100
std::string encode(const grey& picture, extent size, std::string_view format, int quality = 85);

/// Nothing, if this is not a picture of that format and size.
std::optional<grey> decode(std::string_view text, extent size, std::string_view format);

} // namespace fmv
