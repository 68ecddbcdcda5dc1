// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>
#include <cles/standard.hpp>

#include <boost/describe/enumerators.hpp>

#include <concepts>
#include <cstddef>
#include <cstdint>
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
/// - `bool`, integers of up to 64 bits, characters (as numbers), floating-point numbers and strings;
/// - enums described with `BOOST_DESCRIBE_ENUM`, by name, or as a number if they combine flags by an operator `|`;
/// - `std::vector`, `std::array`, `std::tuple` and `std::pair` as arrays;
/// - structs described with `BOOST_DESCRIBE_STRUCT`, and classes with `BOOST_DESCRIBE_CLASS`, as objects, with their
///   described bases and private members;
/// - `std::map` and `std::unordered_map` with keys of type `std::string`, integers and described enums, as objects;
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
/// What readers refuse is not written: text that is not UTF-8, brackets nested deeper than 35 levels, a number, time or
/// enum that has no JSON form. Then `to_json` throws, and nothing is sent.
///
/// A `const char*` that is null is written as null. An array of `char` is text that ends at its first zero, or with the
/// array.
///
/// The functions of this header are not customisation points: `cles::converter` is. Functions `to_json`, `write_json`
/// and the like in the namespace of a type are not called.

namespace cles {
namespace detail {

template <class T>
concept described_struct = std::is_class_v<T> && requires(T** type) {
    boost_public_member_descriptor_fn(type);
    boost_base_descriptor_fn(type);
};

template <class T>
concept described_enum = std::is_enum_v<T> && boost::describe::has_describe_enumerators<T>::value;

/// Integers of up to 64 bits and characters, but not `bool`.
template <class T>
concept whole = std::integral<T> && !std::same_as<T, bool> && sizeof(T) <= sizeof(std::int64_t);

/// The integer of 64 bits that holds every T.
template <whole T>
using widest = std::conditional_t<std::is_signed_v<T>, std::int64_t, std::uint64_t>;

/// As `std::in_range`, which takes no characters.
template <whole To, whole From>
constexpr bool fits(From number) noexcept {
    using like_to = std::conditional_t<std::is_signed_v<To>, std::make_signed_t<To>, std::make_unsigned_t<To>>;
    return std::in_range<like_to>(static_cast<widest<From>>(number));
}

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
///   sent as {"value":x};
/// - optionally `static constexpr std::string_view schema`, a JSON Schema of what `read` accepts, for programs that
///   tell their types (<cles/types.hpp>).
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

template <class... T>
struct types {};

/// Types of the standard library that convert if those in `converter<T>::parts` do.
template <class T>
concept has_parts = requires {
    typename converter<T>::parts;
};

template <class Parts>
inline constexpr bool all_made = true;
template <class... T>
inline constexpr bool all_made<types<T...>> = (std::is_default_constructible_v<T> && ...);
/// Whether reading can make what a container, an optional or a variant holds. Arrays and the like, which cannot be made
/// either, are there before.
template <class T>
inline constexpr bool parts_are_made = true;
template <has_parts T>
inline constexpr bool parts_are_made<T> = !std::is_default_constructible_v<T> || all_made<typename converter<T>::parts>;

/// The first type in T, or T itself, that cannot be written; void if there is none.
template <class T>
struct unwritable {
    using type = T;
};
template <class Parts>
struct first_unwritable {
    using type = void;
};
template <writable T>
struct unwritable<T> {
    using type = void;
};
template <writable T>
    requires has_parts<T>
struct unwritable<T> : first_unwritable<typename converter<T>::parts> {
};
template <class T, class... More>
struct first_unwritable<types<T, More...>> : std::conditional_t<std::is_void_v<typename unwritable<T>::type>,
                                                                first_unwritable<types<More...>>, unwritable<T>> {};

/// The same for reading.
template <class T>
struct unreadable {
    using type = T;
};
template <class Parts>
struct first_unreadable {
    using type = void;
};
template <readable T>
struct unreadable<T> {
    using type = void;
};
template <readable T>
    requires has_parts<T>
struct unreadable<T> : first_unreadable<typename converter<T>::parts> {
};
template <class T, class... More>
struct first_unreadable<types<T, More...>> : std::conditional_t<std::is_void_v<typename unreadable<T>::type>,
                                                                first_unreadable<types<More...>>, unreadable<T>> {};

/// How a key of a map is written and read; only defined for texts, integers and described enums.
template <class Key>
struct map_key;
template <class Key>
concept usable_as_key = requires {
    sizeof(map_key<Key>);
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
    constexpr bool made_first = detail::parts_are_made<T>;
    static_assert(made_first,
                  "what a container, an optional or a variant holds needs a default constructor: it is made "
                  "first, and then read");
    if constexpr (detail::readable<T> && made_first) {
        return converter<T>::read(r, value);
    } else {
        return false;
    }
}

namespace detail {

/// Throws unless the text of this writer, which is not certain to be JSON, is.
[[gnu::cold]] void check_written(const json_writer& w);

/// Everything that is sent passes this: what a receiver would drop fails here, at its cause.
/// \throws cles::error with `conversion` if text that is not UTF-8 was written, or something that is not JSON
inline void require_readable(const json_writer& w) {
    if (!w.is_certain()) {
        detail::check_written(w);
    }
}

} // namespace detail

/// \throws cles::error with `conversion` if text is not UTF-8, or a value has no JSON form that readers accept
template <class T>
std::string to_json(const T& value) {
    std::string out;
    if constexpr (detail::described_struct<T>) {
        constexpr std::size_t usual = 200; // enough for most values without reallocation
        out.reserve(usual);
    }
    json_writer writer{out};
    cles::write_json(writer, value);
    detail::require_readable(writer);
    return out;
}

/// Reads all of `text` as a T. Returns false on failure; `why` (if given) then says what was expected and where.
template <class T>
bool from_json(std::string_view text, T& value, std::string* why = nullptr) {
    json_reader reader{text};
    if (cles::read_json(reader, value) && reader.at_end()) {
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
    constexpr bool made_first = std::is_default_constructible_v<T>;
    static_assert(made_first, "the type needs a default constructor: a value is made first, and then read");
    if constexpr (made_first) {
        T value{};
        std::string why;
        if (!cles::from_json(text, value, &why)) {
            throw error(errc::conversion, why);
        }
        return value;
    }
}

namespace detail {

/// Writes text that ends at the first zero, or after `size` characters.
void write_array(json_writer& w, const char* text, std::size_t size);

/// \throws cles::error with `conversion`, which says what is out of range, if only the original number was finite
double require_finite(double number, bool was_finite, std::string_view why);

/// As `std::isfinite`, whose header would slow down every user's compilation.
template <std::floating_point T>
constexpr bool is_finite(T value) noexcept {
    return value >= std::numeric_limits<T>::lowest() && value <= std::numeric_limits<T>::max();
}

/// \throws cles::error with `conversion` if the text is not JSON, or nested too deep
void write_text(json_writer& w, std::string_view json);

} // namespace detail

template <>
struct converter<bool> {
    static void write(json_writer& w, bool value) { w.value(value); }
    static bool read(json_reader& r, bool& value) { return r.read(value); }
};

/// Characters are numbers, as in C. Wider integers, such as `__int128`, do not convert: no other program could read
/// their numbers.
template <detail::whole T>
struct converter<T> {
    static void write(json_writer& w, T value) { w.value(static_cast<detail::widest<T>>(value)); }
    static bool read(json_reader& r, T& value) {
        detail::widest<T> number{};
        if (!r.read(number)) {
            return false;
        }
        if (!detail::fits<T>(number)) {
            return r.fail("an integer out of range");
        }
        value = static_cast<T>(number);
        return true;
    }
};

template <std::floating_point T>
struct converter<T> {
    static void write(json_writer& w, T value) {
        if constexpr (sizeof(T) > sizeof(double)) {
            w.value(detail::require_finite(static_cast<double>(value), detail::is_finite(value),
                                           "a number out of the range of a double"));
        } else if constexpr (sizeof(T) < sizeof(double)) {
            w.value(static_cast<float>(value));
        } else {
            w.value(static_cast<double>(value));
        }
    }
    static bool read(json_reader& r, T& value) {
        std::conditional_t<(sizeof(T) < sizeof(double)), float, double> number = 0;
        if (!r.read_or_nan(number)) {
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

/// Text that ends at the first zero, or with the array.
template <std::size_t N>
struct converter<char[N]> {
    static void write(json_writer& w, const char (&value)[N]) { detail::write_array(w, value, N); }
};

/// A null pointer is null.
template <>
struct converter<const char*> {
    static void write(json_writer& w, const char* value);
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
    using parts = detail::types<T>;
    static void write(json_writer& w, const std::optional<T>& value) {
        if (value) {
            cles::write_json(w, *value);
        } else {
            w.null();
        }
    }
    static bool read(json_reader& r, std::optional<T>& value) {
        if (r.peek() == json_reader::kind::null) {
            value.reset();
            return r.read_null();
        }
        return cles::read_json(r, value.emplace());
    }
};

} // namespace cles

#include <cles/convert_containers.hpp>
#include <cles/convert_described.hpp>
#include <cles/convert_variant.hpp>
