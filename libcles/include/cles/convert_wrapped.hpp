// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>

/// Scalars are sent as {"value":x}, and unwrapped when read. Not for applications.
///
/// An object {"value":x} is sent as {"value":{"value":x}} if the type would otherwise be read from `x`, as a variant of
/// a number and a struct with the number `value`.

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

/// If the text is {"value":x}, and `x` is a scalar or again such an object: how many of them enclose the scalar.
/// Otherwise 0.
std::size_t levels_around_scalar(std::string_view json, std::string_view& scalar);

/// Whether a T can be read from a scalar.
template <class T>
struct from_scalar {
    static bool reads(std::string_view scalar) {
        if constexpr (described_struct<T> || has_parts<T> || !readable<T> || !std::is_default_constructible_v<T>) {
            return false;
        } else {
            T value{};
            return cles::from_json(scalar, value);
        }
    }
};
template <class T>
struct from_scalar<std::optional<T>> {
    static bool reads(std::string_view scalar) { return scalar == "null" || from_scalar<T>::reads(scalar); }
};
template <class... T>
struct from_scalar<std::variant<T...>> {
    static bool reads(std::string_view scalar) { return (from_scalar<T>::reads(scalar) || ...); }
};

/// Writes a result, an update or what becomes a body: all that is sent. The node wraps scalars.
template <class T>
void write_content(json_writer& w, const T& value) {
    cles::write_json(w, value);
    if constexpr (comes_wrapped<T> && !is_scalar<T>) {
        std::string_view scalar;
        if (levels_around_scalar(w.written(), scalar) != 0 && from_scalar<T>::reads(scalar)) {
            w.enclose("{\"value\":", "}");
        }
    }
}

/// As `to_json`, for what is sent.
template <class T>
std::string to_content(const T& value) {
    if constexpr (comes_wrapped<T> && !is_scalar<T>) {
        std::string out;
        json_writer writer{out};
        detail::write_content(writer, value);
        detail::require_readable(writer);
        return out;
    } else {
        return cles::to_json(value);
    }
}

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

    // Only scalars are wrapped, and objects that look as if they were. So any other object with a member `value` is
    // read as it is.
    static bool read_either(json_reader& r, detail::wrapped<T>& out) {
        std::string_view raw;
        if (!r.read_raw(raw)) {
            return false;
        }
        std::string_view scalar;
        const auto levels = detail::levels_around_scalar(raw, scalar);
        if (levels == 1 || (levels > 1 && detail::from_scalar<T>::reads(scalar))) {
            json_reader part{raw, std::string_view::npos}; // its depth has been checked
            std::string_view key;
            if (part.begin_object() && part.next_key(key) && cles::read_json(part, out.value)) {
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
    auto json = detail::to_content(value);
    if (!json.starts_with('{') && !json.starts_with('[')) {
        json.insert(0, "{\"value\":").push_back('}');
    }
    return json;
}

} // namespace cles::detail
