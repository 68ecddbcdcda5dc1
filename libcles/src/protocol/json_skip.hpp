// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace cles::protocol {

/// Why a text is not JSON.
struct json_flaw {
    enum class kind : std::uint8_t { none, expected, bad, too_deep };
    kind what = kind::none;
    std::string_view text{}; ///< what was expected, or what is bad; static
};

/// Steps over one JSON value of any kind and the white space before it, checking all of it. `at` is then behind the
/// value, or where the flaw is.
json_flaw skip_json(std::string_view text, std::size_t& at, std::size_t max_depth);

} // namespace cles::protocol
