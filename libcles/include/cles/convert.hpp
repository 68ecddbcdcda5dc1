// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>
#include <cles/standard.hpp>

#include <boost/describe/enumerators.hpp>

#include <concepts>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

/// Conversion between C++ types and JSON text, without a document tree in between.
///
/// Supported types:
///
/// - `bool`, integers, floating-point numbers, strings, and enums described with `BOOST_DESCRIBE_ENUM`, by name;
/// - `std::vector`, `std::array`, `std::tuple` and `std::pair` as arrays;
/// - structs described with `BOOST_DESCRIBE_STRUCT` (including described bases), and `std::map` and
///   `std::unordered_map` with keys of type `std::string`, as objects;
/// - `std::optional` as its value or null, `std::variant` as the value that it holds (`<cles/convert_variant.hpp>`);
/// - `std::chrono` durations and points in time of the system clock as ISO 8601 (`<cles/convert_chrono.hpp>`);
/// - `json_text`, JSON that is passed through, and `boost::json::value` with `<cles/json_value.hpp>`.
///
/// Specialise `cles::converter` for other types.
///
/// Reading tolerates differences between versions: unknown members are skipped, and a member may be missing if it is a
/// `std::optional` (which is then empty), or if `CLES_DEFAULTS` names it (`<cles/convert_described.hpp>`). Any other
/// member that is missing or has the wrong type is an error that names the path to it, as in "route[2].lat: expected a
/// number, got a string".
///
/// Text to be written must be UTF-8. Otherwise `to_json` throws, and nothing is sent.

namespace cles {
namespace detail {

template <class T>
concept described_struct = std::is_class_v<T> && requires(T** type) {
    boost_public_member_descriptor_fn(type);
    boost_base_descriptor_fn(type);
};

template <class T>
concept described_enum = std::is_enum_v<T> && boost::describe::has_describe_enumerators<T>::value;

} // namespace detail

/// JSON text as a value. Reading copies it; writing validates it and removes its white space.
struct json_text {
    json_text() = default;
    json_text(std::string json) : text(std::move(json)) {} // NOLINT(google-explicit-constructor): it is text
    json_text(const char* json) : text(json) {}            // NOLINT(google-explicit-constructor)

    std::string text = "{}";
};

/// How T is written and read. A specialisation has
/// - `static void write(json_writer&, const T&)`,
/// - `static bool read(json_reader&, T&)`, and
/// - `static constexpr bool is_scalar = true;` if T is written as neither an object nor an array, because scalars are
///   sent as {"value":x}.
template <class T>
struct converter;

namespace detail {

template <class T>
concept writable = requires(json_writer& w, const T& value) {
    converter<T>::write(w, value);
};
template <class T>
concept readable = requires(json_reader& r, T& value) {
    static_cast<bool>(converter<T>::read(r, value));
};

} // namespace detail

template <class T>
void write_json(json_writer& w, const T& value) {
    static_assert(detail::writable<T>, "this type cannot be written as JSON: describe a struct with "
                                       "BOOST_DESCRIBE_STRUCT, an enum with BOOST_DESCRIBE_ENUM, or specialise "
                                       "cles::converter (see <cles/convert.hpp>)");
    if constexpr (detail::writable<T>) {
        converter<T>::write(w, value);
    }
}

/// Returns false on failure; `json_reader::error` then says what is wrong and where.
template <class T>
bool read_json(json_reader& r, T& value) {
    static_assert(detail::readable<T>, "this type cannot be read from JSON: describe a struct with "
                                       "BOOST_DESCRIBE_STRUCT, an enum with BOOST_DESCRIBE_ENUM, or specialise "
                                       "cles::converter (see <cles/convert.hpp>)");
    if constexpr (detail::readable<T>) {
        return converter<T>::read(r, value);
    } else {
        return false;
    }
}

namespace detail {

[[noreturn, gnu::cold]] void throw_broken_text(const json_writer& w);

/// \throws cles::error with `conversion` if text that is not UTF-8 was written
inline void require_utf8(const json_writer& w) {
    if (w.broken_text() != json_writer::npos) {
        throw_broken_text(w);
    }
}

} // namespace detail

/// \throws cles::error with `conversion` if text is not UTF-8, or a value has no JSON form
template <class T>
std::string to_json(const T& value) {
    std::string out;
    if constexpr (detail::described_struct<T>) {
        constexpr std::size_t usual = 200; // enough for most values without reallocation
        out.reserve(usual);
    }
    json_writer writer{out};
    write_json(writer, value);
    detail::require_utf8(writer);
    return out;
}

/// Reads all of `text` as a T. Returns false on failure; `why` (if given) then says what was expected and where.
template <class T>
bool from_json(std::string_view text, T& value, std::string* why = nullptr) {
    json_reader reader{text};
    if (read_json(reader, value) && reader.at_end()) {
        return true;
    }
    if (why != nullptr) {
        *why = reader.error();
    }
    return false;
}

/// \throws cles::error with `errc::conversion`
template <class T>
T from_json(std::string_view text) {
    T value{};
    std::string why;
    if (!from_json(text, value, &why)) {
        throw error(errc::conversion, why);
    }
    return value;
}

namespace detail {

/// \throws cles::error with `conversion` if the text is not JSON
void write_text(json_writer& w, std::string_view json);

} // namespace detail

template <>
struct converter<bool> {
    static void write(json_writer& w, bool value) { w.value(value); }
    static bool read(json_reader& r, bool& value) { return r.read(value); }
};

template <class T>
    requires(std::integral<T> && !std::same_as<T, bool>)
struct converter<T> {
    using wide = std::conditional_t<std::is_signed_v<T>, std::int64_t, std::uint64_t>;
    static void write(json_writer& w, T value) { w.value(static_cast<wide>(value)); }
    static bool read(json_reader& r, T& value) {
        wide number{};
        if (!r.read(number)) {
            return false;
        }
        if (!std::in_range<T>(number)) {
            return r.fail("an integer out of range");
        }
        value = static_cast<T>(number);
        return true;
    }
};

template <std::floating_point T>
struct converter<T> {
    static void write(json_writer& w, T value) { w.value(static_cast<double>(value)); }
    static bool read(json_reader& r, T& value) {
        if (r.peek() == json_reader::kind::null) { // how numbers that are not finite are written
            value = std::numeric_limits<T>::quiet_NaN();
            return r.read_null();
        }
        double number = 0;
        if (!r.read(number)) {
            return false;
        }
        value = static_cast<T>(number);
        return true;
    }
};

template <>
struct converter<std::string> {
    static void write(json_writer& w, const std::string& value) { w.value(std::string_view{value}); }
    static bool read(json_reader& r, std::string& value) { return r.read(value); }
};

template <>
struct converter<std::string_view> {
    static void write(json_writer& w, std::string_view value) { w.value(value); }
};

template <std::size_t N>
struct converter<char[N]> {
    static void write(json_writer& w, const char* value) { w.value(std::string_view{value}); }
};

template <>
struct converter<const char*> {
    static void write(json_writer& w, const char* value) { w.value(std::string_view{value}); }
};

template <>
struct converter<json_text> {
    static void write(json_writer& w, const json_text& value) { detail::write_text(w, value.text); }
    static bool read(json_reader& r, json_text& value) {
        std::string_view raw;
        if (!r.read_raw(raw)) {
            return false;
        }
        value.text = raw;
        return true;
    }
};

template <class T>
struct converter<std::optional<T>> {
    static void write(json_writer& w, const std::optional<T>& value) {
        if (value) {
            write_json(w, *value);
        } else {
            w.null();
        }
    }
    static bool read(json_reader& r, std::optional<T>& value) {
        if (r.peek() == json_reader::kind::null) {
            value.reset();
            return r.read_null();
        }
        return read_json(r, value.emplace());
    }
};

} // namespace cles

#include <cles/convert_containers.hpp>
#include <cles/convert_described.hpp>
#include <cles/convert_variant.hpp>
