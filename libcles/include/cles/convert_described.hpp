// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/describe_limit.hpp>
#include <cles/field_note.hpp>

#include <boost/describe/enumerators.hpp>
#include <boost/describe/modifiers.hpp>

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

/// Conversion of structs and enums that are described with Boost.Describe; included by `<cles/convert.hpp>`.

/// Names members that may be missing in the JSON that is read: they keep their default member initialisers. So messages
/// can get new members, and those of older senders are still accepted. Write it after the description of the struct, in
/// the struct's namespace (or inside the struct, after `friend`):
///
///     struct position {
///         double lat = 0;
///         double lon = 0;
///         double heading = 0; // since 1.1
///     };
///     BOOST_DESCRIBE_STRUCT(position, (), (lat, lon, heading))
///     CLES_DEFAULTS(position, (heading))
#define CLES_DEFAULTS(type, members)                                                                                   \
    constexpr ::std::string_view cles_members_with_defaults(const type*) noexcept { return #members; }

/// Gives members, or the enumerators of an enum, other names in JSON than in C++, such as a word that C++ reserves.
/// Write it as `CLES_DEFAULTS`, which goes on naming members as C++ does.
///
///     struct pose {
///         std::string klass;
///         double yaw_rate = 0;
///     };
///     BOOST_DESCRIBE_STRUCT(pose, (), (klass, yaw_rate))
///     CLES_NAMES(pose, (klass, "class"), (yaw_rate, "yawRate"))
#define CLES_NAMES(type, ...)                                                                                          \
    constexpr ::std::string_view cles_names_of_members(const type*) noexcept { return #__VA_ARGS__; }

namespace cles {

namespace detail {

// --- The fields of a described struct ---
//
// `boost::describe::describe_members<T, mod_public | mod_inherited>` returns them too. But it needs all of Boost.Mp11,
// which every user of this header would have to compile. So they are collected here from the functions that the macros
// define.

template <class... D>
struct descriptors {};

template <class T>
using bases_of = decltype(boost_base_descriptor_fn(static_cast<T**>(nullptr)));
template <class T>
using public_members_of = decltype(boost_public_member_descriptor_fn(static_cast<T**>(nullptr)));
template <class T>
using protected_members_of = decltype(boost_protected_member_descriptor_fn(static_cast<T**>(nullptr)));
template <class T>
using private_members_of = decltype(boost_private_member_descriptor_fn(static_cast<T**>(nullptr)));

template <class D>
inline constexpr bool is_field = (D::modifiers & (boost::describe::mod_static | boost::describe::mod_function)) == 0;

template <template <class...> class List, class... D>
constexpr bool any_is_named(List<D...>, [[maybe_unused]] std::string_view name) noexcept {
    return ((name == D::name) || ...);
}
/// Whether a class describes a member of this name, which then hides those of its bases.
template <class T>
constexpr bool has_member_named(std::string_view name) noexcept {
    return detail::any_is_named(public_members_of<T>{}, name) ||
           detail::any_is_named(protected_members_of<T>{}, name) || detail::any_is_named(private_members_of<T>{}, name);
}

// Found: the fields so far. Hiding: the derived classes, whose members hide those of their bases.
template <class Found, class Members, class... Hiding>
struct add_fields {
    using type = Found;
};
template <class... F, template <class...> class List, class D, class... More, class... Hiding>
struct add_fields<descriptors<F...>, List<D, More...>, Hiding...>
    : add_fields<std::conditional_t<is_field<D> && !(std::is_same_v<F, D> || ...) &&
                                        !(detail::has_member_named<Hiding>(D::name) || ...),
                                    descriptors<F..., D>, descriptors<F...>>,
                 List<More...>, Hiding...> {};

template <class Found, class Bases, class... Hiding>
struct add_bases {
    using type = Found;
};
template <class Found, class T, class... Hiding>
struct add_class {
    using inherited = typename add_bases<Found, bases_of<T>, T, Hiding...>::type;
    using open = typename add_fields<inherited, public_members_of<T>, Hiding...>::type;
    using closed = typename add_fields<open, protected_members_of<T>, Hiding...>::type;
    using type = typename add_fields<closed, private_members_of<T>, Hiding...>::type;
};
template <class Found, template <class...> class List, class Base, class... More, class... Hiding>
struct add_bases<Found, List<Base, More...>, Hiding...>
    : add_bases<
          typename std::conditional_t<(Base::modifiers & boost::describe::mod_public) != 0,
                                      add_class<Found, typename Base::type, Hiding...>, add_bases<Found, void>>::type,
          List<More...>, Hiding...> {};

/// Descriptors of the data members of a class and of its public described bases, in the order of the description, bases
/// first. Private members are among them if the class describes them, as only it can.
template <class T>
using fields_of = typename add_class<descriptors<>, T>::type;

// --- What CLES_DEFAULTS and CLES_NAMES say about them ---

template <class C>
concept has_defaults = requires {
    cles_members_with_defaults(static_cast<const C*>(nullptr));
};
template <class C>
concept has_names = requires {
    cles_names_of_members(static_cast<const C*>(nullptr));
};

inline constexpr std::string_view between_names = "(), ";

/// Removes the next name from a list such as "(lat, lon)" and returns it; empty at the end.
constexpr std::string_view next_name(std::string_view& list) noexcept {
    while (!list.empty() && between_names.find(list.front()) != std::string_view::npos) {
        list.remove_prefix(1);
    }
    const auto name = list.substr(0, list.find_first_of(between_names));
    list.remove_prefix(name.size());
    return name;
}

/// Removes the text in quotation marks that is next in a list and returns it; empty if there is none that JSON could
/// contain as it is.
constexpr std::string_view next_quoted(std::string_view& list) noexcept {
    const auto open = list.find_first_not_of(between_names);
    if (open == std::string_view::npos || list[open] != '"') {
        return {};
    }
    list.remove_prefix(open + 1);
    const auto text = list.substr(0, list.find('"'));
    list.remove_prefix(text.size() == list.size() ? text.size() : text.size() + 1);
    for (const auto c : text) {
        if (c == '\\' || (c >= '\0' && c < ' ')) {
            return {};
        }
    }
    return text;
}

/// Whether `CLES_DEFAULTS` of this class, or of a base if it has none, names the member.
template <class C>
constexpr bool has_default(std::string_view member) noexcept {
    if constexpr (has_defaults<C>) {
        auto list = cles_members_with_defaults(static_cast<const C*>(nullptr));
        for (auto name = next_name(list); !name.empty(); name = next_name(list)) {
            if (name == member) {
                return true;
            }
        }
    }
    return false;
}

/// The name that `CLES_NAMES` of this type, or of a base if it has none, gives the member; otherwise its own.
template <class C>
constexpr std::string_view renamed(std::string_view member) noexcept {
    if constexpr (has_names<C>) {
        auto list = cles_names_of_members(static_cast<const C*>(nullptr));
        for (auto next = next_name(list); !next.empty(); next = next_name(list)) {
            const auto name = next_quoted(list);
            if (next == member) {
                return name;
            }
        }
    }
    return member;
}

template <class M, class C>
C class_of(M C::*);

/// The name of a member of T in JSON.
template <class T, class D>
constexpr std::string_view json_name() noexcept {
    const auto name = detail::renamed<T>(D::name);
    return name == D::name ? detail::renamed<decltype(detail::class_of(D::pointer))>(D::name) : name;
}

template <class T, class... D>
constexpr bool defaults_are_known(descriptors<D...> fields) noexcept {
    if constexpr (has_defaults<T>) {
        auto list = cles_members_with_defaults(static_cast<const T*>(nullptr));
        for (auto name = next_name(list); !name.empty(); name = next_name(list)) {
            if (!detail::any_is_named(fields, name)) {
                return false;
            }
        }
    }
    return true;
}

template <class T, class List>
constexpr bool names_are_known(List described) noexcept {
    if constexpr (has_names<T>) {
        auto list = cles_names_of_members(static_cast<const T*>(nullptr));
        for (auto name = next_name(list); !name.empty(); name = next_name(list)) {
            if (!detail::any_is_named(described, name) || next_quoted(list).empty()) {
                return false;
            }
        }
    }
    return true;
}

constexpr bool all_differ(std::initializer_list<std::string_view> names) noexcept {
    for (const auto* one = names.begin(); one != names.end(); ++one) {
        for (const auto* other = names.begin(); other != one; ++other) {
            if (*one == *other) {
                return false;
            }
        }
    }
    return true;
}

/// True. With a compiler error if what was said about the members of T is wrong.
template <class T, class... D>
constexpr bool is_well_described(descriptors<D...>) noexcept {
    static_assert(detail::defaults_are_known<T>(descriptors<D...>{}),
                  "CLES_DEFAULTS names a member that BOOST_DESCRIBE_STRUCT does not");
    static_assert(detail::names_are_known<T>(descriptors<D...>{}),
                  "CLES_NAMES takes members that BOOST_DESCRIBE_STRUCT names, each with a name in JSON that needs no "
                  "escapes, as in CLES_NAMES(pose, (klass, \"class\"))");
    if constexpr (has_names<T>) {
        static_assert(all_differ({detail::json_name<T, D>()...}), "CLES_NAMES gives two members the same name");
    }
    return true;
}

// --- How they are read ---

template <class T>
inline constexpr bool is_optional = false;
template <class T>
inline constexpr bool is_optional<std::optional<T>> = true;

struct field {
    prepared_key key;
    bool (*read)(json_reader& r, void* object);
    bool required;

    [[nodiscard]] constexpr std::string_view name() const noexcept { return key.name(); }
};

template <class T, class D>
inline constexpr prepared_key_text<detail::json_name<T, D>().size()> key_of{detail::json_name<T, D>()};

bool read_fields(json_reader& r, void* object, std::span<const field> fields);

/// Deleted, so that the compiler's message names the member and its type, or the type in it. To convert the type,
/// describe it, or specialise cles::converter.
template <auto Member, class Type>
void member_cannot_be_read_from_JSON() = delete;
template <auto Member, class Type>
void member_cannot_be_written_as_JSON() = delete;

/// Whether a member may not be missing in what is read.
template <class T, class D>
constexpr bool is_required() noexcept {
    using value = std::remove_cvref_t<decltype(std::declval<T&>().*D::pointer)>;
    using owner = decltype(detail::class_of(D::pointer));
    return !is_optional<value> && !detail::has_default<owner>(D::name) && !detail::has_default<T>(D::name);
}

/// What `CLES_FIELD` says about a member of T; nothing if it says nothing.
template <class T, class D>
constexpr field_note note_of() noexcept {
    if constexpr (requires { cles_note_of_member(static_cast<const T*>(nullptr), member_tag<D::pointer>{}); }) {
        return cles_note_of_member(static_cast<const T*>(nullptr), member_tag<D::pointer>{});
    } else {
        return {};
    }
}

template <class T>
struct number_in {
    using type = T;
};
template <class T>
struct number_in<std::optional<T>> {
    using type = T;
};

/// Whether `CLES_FIELD` gives the member a range; with a compiler error if it is not a number.
template <class T, class D>
constexpr bool has_range() noexcept {
    constexpr auto note = detail::note_of<T, D>();
    if constexpr (note.has_range()) {
        using number = typename number_in<std::remove_cvref_t<decltype(std::declval<T&>().*D::pointer)>>::type;
        constexpr bool is_number = std::is_arithmetic_v<number> && !std::is_same_v<number, bool>;
        static_assert(is_number, "CLES_FIELD gives a range to a member that is not a number");
        static_assert(note.minimum <= note.maximum, "CLES_FIELD takes the minimum, then the maximum");
        return is_number;
    } else {
        return false;
    }
}

template <class T>
constexpr bool is_inside(const T& number, const field_note& range) noexcept {
    const auto wide = static_cast<long double>(number); // holds all integers of 64 bits
    return !(wide < range.minimum) && !(wide > range.maximum);
}
template <class T>
constexpr bool is_inside(const std::optional<T>& number, const field_note& range) noexcept {
    return !number || detail::is_inside(*number, range);
}

/// Fails: the number that was read is not in its range.
[[gnu::cold]] bool fail_range(json_reader& r, double minimum, double maximum);
/// \throws cles::error with `conversion`, because readers would refuse the number of that member
[[noreturn, gnu::cold]] void throw_range(const json_writer& w, double minimum, double maximum);

template <class T, class D>
constexpr field field_for() {
    using member = std::remove_reference_t<decltype(std::declval<T&>().*D::pointer)>;
    using value = std::remove_cv_t<member>;
    using wrong = std::conditional_t<std::is_const_v<member>, member, typename unreadable<value>::type>;
    return {key_of<T, D>,
            [](json_reader& r, void* object) {
                if constexpr (!std::is_void_v<wrong>) {
                    member_cannot_be_read_from_JSON<D::pointer, wrong>();
                    return false;
                } else if constexpr (detail::has_range<T, D>()) {
                    constexpr auto range = detail::note_of<T, D>();
                    auto& number = static_cast<T*>(object)->*D::pointer;
                    return cles::read_json(r, number) &&
                           (detail::is_inside(number, range) || detail::fail_range(r, range.minimum, range.maximum));
                } else {
                    return cles::read_json(r, static_cast<T*>(object)->*D::pointer);
                }
            },
            detail::is_required<T, D>()};
}

template <class T, class... D>
constexpr std::array<field, sizeof...(D)> table_of(descriptors<D...>) {
    return {field_for<T, D>()...};
}

template <class T>
inline constexpr auto field_table = table_of<T>(fields_of<T>{});

constexpr bool is_among(std::span<const field> fields, std::string_view name) noexcept {
    for (const auto& f : fields) {
        if (f.name() == name) {
            return true;
        }
    }
    return false;
}

// --- How they are written ---

template <class D, class T>
void write_field(json_writer& w, const T& object) {
    const auto& value = object.*D::pointer;
    using wrong = typename unwritable<std::remove_cvref_t<decltype(value)>>::type;
    if constexpr (detail::has_range<T, D>()) {
        constexpr auto range = detail::note_of<T, D>();
        if (!detail::is_inside(value, range)) {
            w.plain_key(key_of<T, D>);
            detail::throw_range(w, range.minimum, range.maximum);
        }
    }
    if constexpr (!std::is_void_v<wrong>) {
        member_cannot_be_written_as_JSON<D::pointer, wrong>();
    } else if constexpr (is_optional<std::remove_cvref_t<decltype(value)>>) {
        if (value) {
            w.plain_key(key_of<T, D>);
            cles::write_json(w, *value);
        }
    } else {
        w.plain_key(key_of<T, D>);
        cles::write_json(w, value);
    }
}

template <class T, class... D>
void write_fields(json_writer& w, const T& object, descriptors<D...>) {
    (detail::write_field<D>(w, object), ...);
}

// --- Enums ---

/// A described enum, for functions that do not depend on its type. Its values are their bits, with those of the sign.
struct enum_values {
    std::span<const std::string_view> names;
    std::span<const std::uint64_t> values;
    bool is_signed;
    bool has_union; ///< an operator `|`, by which it is a set of flags
};

/// A value without a name is a number if it combines flags, and otherwise an error.
/// \throws cles::error with `conversion`
void write_enum(json_writer& w, const enum_values& known, std::uint64_t value);
bool read_enum(json_reader& r, const enum_values& known, std::uint64_t& value);
/// The same as the text of a key.
std::string enum_key(const enum_values& known, std::uint64_t value);
bool read_enum_key(json_reader& r, std::string_view key, const enum_values& known, std::uint64_t& value);

template <class E>
struct enumerator_table {
    template <template <class...> class List, class... D>
    constexpr explicit enumerator_table(List<D...>)
        : names{detail::renamed<E>(D::name)...}, values{enumerator_table::bits(D::value)...} {
        static_assert(
            detail::names_are_known<E>(List<D...>{}),
            "CLES_NAMES takes enumerators that BOOST_DESCRIBE_ENUM names, each with a name in JSON that needs "
            "no escapes, as in CLES_NAMES(mode, (off, \"default\"))");
        if constexpr (has_names<E>) {
            static_assert(all_differ({detail::renamed<E>(D::name)...}),
                          "CLES_NAMES gives two enumerators the same name");
        }
    }
    static constexpr std::uint64_t bits(E value) noexcept {
        return static_cast<std::uint64_t>(static_cast<std::underlying_type_t<E>>(value));
    }

    static constexpr std::size_t count = []<template <class...> class List, class... D>(List<D...>) {
        return sizeof...(D);
    }(boost::describe::describe_enumerators<E>{});
    std::array<std::string_view, count> names;
    std::array<std::uint64_t, count> values;
};
template <class E>
inline constexpr enumerator_table<E> enumerators{boost::describe::describe_enumerators<E>{}};
template <class E>
concept has_union = requires(E some, E others) {
    { some | others } -> std::same_as<E>;
};
template <class E>
inline constexpr enum_values values_of{enumerators<E>.names, enumerators<E>.values,
                                       std::is_signed_v<std::underlying_type_t<E>>, has_union<E>};

template <described_enum T>
struct map_key<T> {
    static std::string text(T key) { return enum_key(values_of<T>, enumerator_table<T>::bits(key)); }
    static bool read(json_reader& r, std::string_view text, T& key) {
        std::uint64_t bits = 0;
        if (!read_enum_key(r, text, values_of<T>, bits)) {
            return false;
        }
        key = static_cast<T>(static_cast<std::underlying_type_t<T>>(bits));
        return true;
    }
};

} // namespace detail

template <detail::described_enum T>
struct converter<T> {
    static constexpr bool is_described = true; ///< not specialised for this type
    static void write(json_writer& w, T value) {
        detail::write_enum(w, detail::values_of<T>, detail::enumerator_table<T>::bits(value));
    }
    static bool read(json_reader& r, T& value) {
        std::uint64_t bits = 0;
        if (!detail::read_enum(r, detail::values_of<T>, bits)) {
            return false;
        }
        value = static_cast<T>(static_cast<std::underlying_type_t<T>>(bits));
        return true;
    }
};

template <detail::described_struct T>
struct converter<T> {
    static constexpr bool is_described = true; ///< not specialised for this type
    static void write(json_writer& w, const T& object) {
        static_assert(detail::is_well_described<T>(detail::fields_of<T>{}));
        w.begin_object();
        detail::write_fields(w, object, detail::fields_of<T>{});
        w.end_object();
    }
    static bool read(json_reader& r, T& object) {
        static_assert(detail::is_well_described<T>(detail::fields_of<T>{}));
        return detail::read_fields(r, std::addressof(object), detail::field_table<T>);
    }
};

} // namespace cles
