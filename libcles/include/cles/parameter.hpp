// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/standard.hpp>

#include <string>
#include <string_view>

namespace cles {

/// A parameter as a noun contains it, for any text: `"car0:tyre/" + cles::encode_parameter("front left")`. Letters,
/// digits and `_-.~+` stay as they are, all other bytes become %HH. Handlers receive parameters decoded.
/// \throws cles::error with `invalid_name` if no node accepts the parameter: it is empty, not UTF-8, or has control
/// characters
std::string encode_parameter(std::string_view text);

} // namespace cles
