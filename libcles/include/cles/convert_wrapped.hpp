// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <string>
#include <string_view>
#include <type_traits>

/// Scalars travel as {"value":x}, and come unwrapped. Not for applications.

namespace cles::detail {

template <class T>
struct wrapped {
    T value;
};
template <class T>
inline constexpr bool comes_wrapped = std::is_arithmetic_v<T> || std::is_same_v<T, std::string> || described_enum<T>;

} // namespace cles::detail

namespace cles {
template <class T>
struct converter<detail::wrapped<T>> {
    static bool read(json_reader& r, detail::wrapped<T>& out) {
        bool found = false;
        std::string_view key;
        if (!r.begin_object()) {
            return false;
        }
        while (r.next_key(key)) {
            if (key != "value") {
                if (!r.skip()) {
                    return false;
                }
            } else if (read_json(r, out.value)) {
                found = true;
            } else {
                r.inside_member("value");
                return false;
            }
        }
        if (r.ok() && !found) {
            r.fail("is missing");
            r.inside_member("value");
        }
        return r.ok();
    }
};
} // namespace cles
