// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/convert_chrono.hpp>
#include <cles/convert_wrapped.hpp>
#include <cles/field_note.hpp>
#include <cles/text_list.hpp>

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <variant>
#include <vector>

/// The schema of a C++ type (docs/protocol.md, "Types"), derived from how it converts. Included by `<cles/types.hpp>`.
/// Not for applications.

namespace cles::detail {

/// Writes schemas. Each function writes members of the object that is open.
class schema_writer {
  public:
    schema_writer();
    schema_writer(const schema_writer&) = delete;
    schema_writer& operator=(const schema_writer&) = delete;
    ~schema_writer();

    /// The open object.
    [[nodiscard]] json_writer& json() noexcept { return *out_; }

    void type(std::string_view name);
    /// `minimum` may be negative; `maximum` is not.
    void integer(std::int64_t minimum, std::uint64_t maximum);
    void number(bool is_float);
    /// Text, and null if it may be.
    void text(bool or_null);
    void count(std::string_view keyword, std::size_t n);
    void enumeration(const enum_values& known);

    /// How keys of a map are restricted, as the value of `propertyNames`.
    void integer_keys(std::int64_t minimum, std::uint64_t maximum);
    void enum_keys(const enum_values& known);

    /// The unit of a time, `num`/`den` seconds, and what its count can be.
    struct ticks {
        std::int64_t num;
        std::int64_t den;
        std::int64_t minimum = 0;
        std::int64_t maximum = 0;
        std::int64_t bits = 0; ///< of a floating-point count; 0: an integer
    };
    void time(std::string_view format, const ticks& unit, bool or_null);

    /// What `CLES_FIELD` says. The range is that of the next number.
    void note(const field_note& what);
    /// The schema of a type of the program, as the text of an object.
    void stated(std::string_view schema);

    /// Refers to the definition of a type, which is written by `define` at the first time. So a type may contain
    /// itself. `compiled` contains the type's name as the compiler writes it.
    void refer(const void* type, std::string_view compiled, void (*define)(schema_writer&));

    /// The whole schema. \throws cles::error with `conversion` if it is nested deeper than readers accept
    [[nodiscard]] std::string finish();

  private:
    struct definition;

    void limits(std::int64_t minimum, std::uint64_t maximum);
    void names(const enum_values& known);
    void flags(const enum_values& known);

    std::string text_;
    json_writer root_{text_};
    json_writer* out_ = &root_;
    std::vector<std::unique_ptr<definition>> definitions_;
    std::optional<field_note> range_;
};

template <class T>
struct type_schema;

/// Writes the schema of a T into the open object.
template <class T>
void write_schema(schema_writer& s) {
    type_schema<std::remove_cv_t<T>>::write(s);
}

/// Writes it as a value.
template <class T>
void write_schema_value(schema_writer& s) {
    s.json().begin_object();
    detail::write_schema<T>(s);
    s.json().end_object();
}

template <class... T>
void write_any_of(schema_writer& s) {
    s.json().plain_key("anyOf");
    s.json().begin_array();
    (detail::write_schema_value<T>(s), ...);
    s.json().end_array();
}

template <class... T>
void write_elements(schema_writer& s) {
    s.type("array");
    if constexpr (sizeof...(T) != 0) {
        s.json().plain_key("prefixItems");
        s.json().begin_array();
        (detail::write_schema_value<T>(s), ...);
        s.json().end_array();
    }
    s.count("minItems", sizeof...(T));
    s.count("maxItems", sizeof...(T));
}

/// A type with a converter of the program: anything, or what the converter states as `schema`.
template <class T>
struct type_schema {
    static void write(schema_writer& s) {
        if constexpr (requires { std::string_view{converter<T>::schema}; }) {
            s.stated(converter<T>::schema);
        }
    }
};

template <>
struct type_schema<bool> {
    static void write(schema_writer& s) { s.type("boolean"); }
};

template <whole T>
struct type_schema<T> {
    using numbers = std::numeric_limits<T>;
    static constexpr auto minimum = static_cast<std::int64_t>(numbers::min());
    static constexpr auto maximum = static_cast<std::uint64_t>(numbers::max());
    static void write(schema_writer& s) { s.integer(minimum, maximum); }
};

template <std::floating_point T>
struct type_schema<T> {
    static void write(schema_writer& s) { s.number(sizeof(T) < sizeof(double)); }
};

template <>
struct type_schema<std::string> {
    static void write(schema_writer& s) { s.text(false); }
};
template <>
struct type_schema<std::string_view> : type_schema<std::string> {};
template <std::size_t N>
struct type_schema<char[N]> : type_schema<std::string> {}; // NOLINT(modernize-avoid-c-arrays): as structs of C have it
template <>
struct type_schema<const char*> {
    static void write(schema_writer& s) { s.text(true); }
};

template <>
struct type_schema<std::monostate> {
    static void write(schema_writer& s) { s.type("null"); }
};

template <described_enum T>
    requires(requires { converter<T>::is_described; })
struct type_schema<T> {
    static void write(schema_writer& s) { s.enumeration(values_of<T>); }
};

template <class T>
struct type_schema<std::optional<T>> {
    static void write(schema_writer& s) { detail::write_any_of<T, std::monostate>(s); }
};

template <class... T>
struct type_schema<std::variant<T...>> {
    static void write(schema_writer& s) { detail::write_any_of<T...>(s); }
};

template <class T, class A>
struct type_schema<std::vector<T, A>> {
    static void write(schema_writer& s) {
        s.type("array");
        s.json().plain_key("items");
        detail::write_schema_value<T>(s);
    }
};
template <>
struct type_schema<text_list> : type_schema<std::vector<std::string>> {};

template <class T, std::size_t N>
struct type_schema<std::array<T, N>> {
    static void write(schema_writer& s) {
        type_schema<std::vector<T>>::write(s);
        s.count("minItems", N);
        s.count("maxItems", N);
    }
};

template <class... T>
struct type_schema<std::tuple<T...>> {
    static void write(schema_writer& s) { detail::write_elements<T...>(s); }
};
template <class T, class U>
struct type_schema<std::pair<T, U>> {
    static void write(schema_writer& s) { detail::write_elements<T, U>(s); }
};

template <class Key, class T>
struct map_schema {
    static void write(schema_writer& s) {
        s.type("object");
        if constexpr (whole<Key>) {
            s.json().plain_key("propertyNames");
            s.integer_keys(type_schema<Key>::minimum, type_schema<Key>::maximum);
        } else if constexpr (described_enum<Key>) {
            s.json().plain_key("propertyNames");
            s.enum_keys(values_of<Key>);
        }
        s.json().plain_key("additionalProperties");
        detail::write_schema_value<T>(s);
    }
};
template <class Key, class T, class C, class A>
struct type_schema<std::map<Key, T, C, A>> : map_schema<Key, T> {};
template <class Key, class T, class H, class E, class A>
struct type_schema<std::unordered_map<Key, T, H, E, A>> : map_schema<Key, T> {};

/// What the count of a time can be; it is read as an integer of 64 bits.
template <class Rep, class Period>
constexpr schema_writer::ticks ticks_of() noexcept {
    schema_writer::ticks unit{.num = Period::num, .den = Period::den};
    if constexpr (std::is_floating_point_v<Rep>) {
        unit.bits = sizeof(Rep) < sizeof(double) ? 32 : 64;
    } else {
        using numbers = std::numeric_limits<Rep>;
        constexpr auto most = std::numeric_limits<std::int64_t>::max();
        unit.minimum = static_cast<std::int64_t>(numbers::min());
        unit.maximum = std::in_range<std::int64_t>(numbers::max()) ? static_cast<std::int64_t>(numbers::max()) : most;
    }
    return unit;
}
template <class Rep, class Period>
struct type_schema<std::chrono::duration<Rep, Period>> {
    static void write(schema_writer& s) { s.time("duration", ticks_of<Rep, Period>(), std::is_floating_point_v<Rep>); }
};
template <class Rep, class Period>
struct type_schema<std::chrono::time_point<std::chrono::system_clock, std::chrono::duration<Rep, Period>>> {
    static void write(schema_writer& s) { s.time("date-time", ticks_of<Rep, Period>(), false); }
};

/// The compiler's text for a function of T, which contains the name of T.
template <class T>
constexpr std::string_view compiled_text() noexcept {
    return __PRETTY_FUNCTION__;
}
/// Its address stands for the type.
template <class T>
inline constexpr const char* type_mark = "";

template <described_struct T>
    requires(requires { converter<T>::is_described; })
struct type_schema<T> {
    static void write(schema_writer& s) {
        s.refer(static_cast<const void*>(&type_mark<T>), compiled_text<T>(), &define);
    }

  private:
    static void define(schema_writer& s) { define_fields(s, fields_of<T>{}); }

    template <class... D>
    static void define_fields(schema_writer& s, descriptors<D...> fields) {
        static_assert(detail::is_well_described<T>(descriptors<D...>{}));
        s.type("object");
        s.json().plain_key("properties");
        s.json().begin_object();
        (define_field<D>(s), ...);
        s.json().end_object();
        if constexpr ((detail::is_required<T, D>() || ...)) {
            s.json().plain_key("required");
            s.json().begin_array();
            (require<D>(s), ...);
            s.json().end_array();
        }
        static_cast<void>(fields);
    }

    template <class D>
    static void require(schema_writer& s) {
        if constexpr (detail::is_required<T, D>()) {
            s.json().value(detail::json_name<T, D>());
        }
    }

    template <class D>
    static void define_field(schema_writer& s) {
        using member = std::remove_cvref_t<decltype(std::declval<T&>().*D::pointer)>;
        s.json().plain_key(detail::json_name<T, D>());
        s.json().begin_object();
        if constexpr (constexpr auto note = detail::note_of<T, D>();
                      note.has_range() || !note.unit.empty() || !note.meaning.empty()) {
            s.note(note);
        }
        if constexpr (!detail::is_required<T, D>() && !is_optional<member> && std::is_default_constructible_v<T> &&
                      std::is_void_v<typename unwritable<member>::type>) {
            if (const auto text = default_of<D>(); !text.empty()) {
                s.json().plain_key("default");
                s.json().raw(text);
            }
        }
        detail::write_schema<member>(s);
        s.json().end_object();
    }

    // What the member is if it is missing; empty if that has no JSON form.
    template <class D>
    static std::string default_of() {
        try {
            const T made{};
            return cles::to_json(made.*D::pointer);
        } catch (const error&) {
            return {};
        }
    }
};

/// Any scalar.
struct any_scalar {};
template <>
struct type_schema<any_scalar> {
    static void write(schema_writer& s) { s.stated(R"({"type":["string","number","boolean","null"]})"); }
};
/// What is a One and an Other.
template <class One, class Other>
struct both {};
template <class One, class Other>
struct type_schema<both<One, Other>> {
    static void write(schema_writer& s) {
        s.json().plain_key("allOf");
        s.json().begin_array();
        detail::write_schema_value<One>(s);
        detail::write_schema_value<Other>(s);
        s.json().end_array();
    }
};
/// {"value":x}. \tparam Alone it has no other member
template <class T, bool Alone, bool Required = true>
struct enclosed {};
template <class T, bool Alone, bool Required>
struct type_schema<enclosed<T, Alone, Required>> {
    static void write(schema_writer& s) {
        s.type("object");
        s.json().plain_key("properties");
        s.json().begin_object();
        s.json().plain_key("value");
        detail::write_schema_value<T>(s);
        s.json().end_object();
        if constexpr (Required) {
            s.stated(R"({"required":["value"]})");
        }
        if constexpr (Alone) {
            s.stated(R"({"additionalProperties":false,"maxProperties":1})");
        }
    }
};

/// A scalar that is read as a T, in one {"value":x} or several.
template <class T>
struct enclosed_scalar {};
template <class T>
struct type_schema<enclosed_scalar<T>> {
    static void write(schema_writer& s) {
        s.refer(static_cast<const void*>(&type_mark<enclosed_scalar<T>>), "T = enclosed;", &define);
    }

  private:
    static void define(schema_writer& s) {
        detail::write_any_of<enclosed<both<any_scalar, T>, true>, enclosed<enclosed_scalar<T>, true>>(s);
    }
};

/// What is sent of a T, and what is read as one: a body, a result or an update (`wrapped`).
template <class T>
struct content {};
template <class T>
struct type_schema<content<T>> {
    static void write(schema_writer& s) {
        if constexpr (is_scalar<T> || std::is_same_v<T, std::string_view> || std::is_same_v<T, const char*>) {
            detail::write_schema<enclosed<T, false, !is_optional<T>>>(s);
        } else if constexpr (comes_wrapped<T>) {
            using scalar = both<any_scalar, T>;
            detail::write_any_of<T, enclosed<scalar, true>, enclosed<both<enclosed_scalar<T>, T>, true>>(s);
        } else {
            detail::write_schema<T>(s);
        }
    }
};
/// No result is {}.
template <>
struct type_schema<content<void>> {
    static void write(schema_writer& s) {
        s.type("object");
        s.count("maxProperties", 0);
    }
};

} // namespace cles::detail
