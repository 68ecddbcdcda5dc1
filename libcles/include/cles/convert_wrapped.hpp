// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>

/// Scalars are sent as {"value":x}, and unwrapped when read. Not for applications.

namespace cles::detail {

template <class T>
struct wrapped {
    T value;
};

/// Types that are always written as a scalar.
template <class T>
inline constexpr bool is_scalar =
    std::is_arithmetic_v<T> || std::is_same_v<T, std::string> || described_enum<T> || requires {
    requires converter<T>::is_scalar;
};
template <class T>
inline constexpr bool is_scalar<std::optional<T>> = is_scalar<T>;
template <class... T>
inline constexpr bool is_scalar<std::variant<T...>> = (is_scalar<T> && ...);

/// Types that may be written as a scalar.
template <class T>
inline constexpr bool comes_wrapped = is_scalar<T>;
template <class T>
inline constexpr bool comes_wrapped<std::optional<T>> = true; // as null
template <class... T>
inline constexpr bool comes_wrapped<std::variant<T...>> = (comes_wrapped<T> || ...);

} // namespace cles::detail

namespace cles {
template <class T>
struct converter<detail::wrapped<T>> {
    static bool read(json_reader& r, detail::wrapped<T>& out) {
        if constexpr (detail::is_scalar<T>) {
            return read_wrapped(r, out);
        } else {
            return read_either(r, out);
        }
    }

  private:
    static bool read_wrapped(json_reader& r, detail::wrapped<T>& out) {
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
            } else if (cles::read_json(r, out.value)) {
                found = true;
            } else {
                r.inside_member("value");
                return false;
            }
        }
        if constexpr (detail::is_optional<T>) {
            found = true; // a missing value is an empty optional
        }
        if (r.ok() && !found) {
            r.fail("is missing");
            r.inside_member("value");
        }
        return r.ok();
    }

    // Only scalars are wrapped. So an object whose member `value` is not a scalar is read as it is.
    static bool read_either(json_reader& r, detail::wrapped<T>& out) {
        std::string_view raw;
        if (!r.read_raw(raw)) {
            return false;
        }
        json_reader scalar{raw, std::string_view::npos}; // its depth has been checked
        if (scalar.peek() == json_reader::kind::object && scalar.begin_object()) {
            std::string_view key;
            if (scalar.next_key(key) && key == "value" && scalar.peek() != json_reader::kind::object &&
                scalar.peek() != json_reader::kind::array && cles::read_json(scalar, out.value) &&
                !scalar.next_key(key) && scalar.ok()) {
                return true;
            }
        }
        json_reader plain{raw, std::string_view::npos};
        return cles::read_json(plain, out.value) || r.fail_as(plain);
    }
};
} // namespace cles

namespace cles::detail {

/// Writes a value as the body of a message.
template <class T>
std::string to_body(const T& value) {
    if constexpr (!is_scalar<T> && !comes_wrapped<T> && !std::is_convertible_v<const T&, std::string_view>) {
        return cles::to_json(value);
    } else {
        constexpr std::string_view head = "{\"value\":";
        std::string out{head};
        json_writer writer{out};
        cles::write_json(writer, value);
        require_readable(writer);
        if (out[head.size()] == '{' || out[head.size()] == '[') {
            return out.substr(head.size());
        }
        out.push_back('}');
        return out;
    }
}

} // namespace cles::detail
