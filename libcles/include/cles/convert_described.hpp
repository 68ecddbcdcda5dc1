// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <boost/describe/class.hpp>
#include <boost/describe/enum.hpp>
#include <boost/describe/enumerators.hpp>
#include <boost/describe/modifiers.hpp>

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
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
struct add_class
    : add_fields<typename add_bases<Found, bases_of<T>, T, Hiding...>::type, public_members_of<T>, Hiding...> {};
template <class Found, template <class...> class List, class Base, class... More, class... Hiding>
struct add_bases<Found, List<Base, More...>, Hiding...>
    : add_bases<
          typename std::conditional_t<(Base::modifiers & boost::describe::mod_public) != 0,
                                      add_class<Found, typename Base::type, Hiding...>, add_bases<Found, void>>::type,
          List<More...>, Hiding...> {};

/// Descriptors of the public data members of a struct and of its public described bases, in declaration order, bases
/// first.
template <class T>
using fields_of = typename add_class<descriptors<>, T>::type;

// --- How they are read ---

template <class T>
inline constexpr bool is_optional = false;
template <class T>
inline constexpr bool is_optional<std::optional<T>> = true;

struct field {
    std::string_view name;
    bool (*read)(json_reader& r, void* object);
    bool required;
};

bool read_fields(json_reader& r, void* object, std::span<const field> fields);

template <class M, class C>
C class_of(M C::*);

template <class C>
concept has_defaults = requires {
    cles_members_with_defaults(static_cast<const C*>(nullptr));
};

/// Removes the next name from a list such as "(lat, lon)" and returns it; empty at the end.
constexpr std::string_view next_name(std::string_view& list) noexcept {
    constexpr std::string_view between = "(), ";
    while (!list.empty() && between.find(list.front()) != std::string_view::npos) {
        list.remove_prefix(1);
    }
    const auto name = list.substr(0, list.find_first_of(between));
    list.remove_prefix(name.size());
    return name;
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

template <class T, class D>
constexpr field field_for() {
    using value = std::remove_cvref_t<decltype(std::declval<T&>().*D::pointer)>;
    using owner = decltype(detail::class_of(D::pointer));
    return {D::name,
            [](json_reader& r, void* object) { return cles::read_json(r, static_cast<T*>(object)->*D::pointer); },
            !is_optional<value> && !detail::has_default<owner>(D::name) && !detail::has_default<T>(D::name)};
}

template <class T, class... D>
constexpr std::array<field, sizeof...(D)> table_of(descriptors<D...>) {
    return {field_for<T, D>()...};
}

template <class T>
inline constexpr auto field_table = table_of<T>(fields_of<T>{});

constexpr bool is_among(std::span<const field> fields, std::string_view name) noexcept {
    for (const auto& f : fields) {
        if (f.name == name) {
            return true;
        }
    }
    return false;
}

template <class T>
constexpr bool defaults_are_fields() noexcept {
    if constexpr (has_defaults<T>) {
        auto list = cles_members_with_defaults(static_cast<const T*>(nullptr));
        for (auto name = next_name(list); !name.empty(); name = next_name(list)) {
            if (!is_among(field_table<T>, name)) {
                return false;
            }
        }
    }
    return true;
}

// --- How they are written ---

template <class D>
inline constexpr prepared_key_text<std::string_view{D::name}.size()> key_of{D::name};

template <class D, class T>
void write_field(json_writer& w, const T& object) {
    const auto& value = object.*D::pointer;
    if constexpr (is_optional<std::remove_cvref_t<decltype(value)>>) {
        if (value) {
            w.plain_key(key_of<D>);
            cles::write_json(w, *value);
        }
    } else {
        w.plain_key(key_of<D>);
        cles::write_json(w, value);
    }
}

template <class T, class... D>
void write_fields(json_writer& w, const T& object, descriptors<D...>) {
    (detail::write_field<D>(w, object), ...);
}

// --- Enums ---

template <class E>
struct enumerator_table {
    template <template <class...> class List, class... D>
    constexpr explicit enumerator_table(List<D...>) : names{D::name...}, values{D::value...} {}

    static constexpr std::size_t count = []<template <class...> class List, class... D>(List<D...>) {
        return sizeof...(D);
    }(boost::describe::describe_enumerators<E>{});
    std::array<std::string_view, count> names;
    std::array<E, count> values;
};
template <class E>
inline constexpr enumerator_table<E> enumerators{boost::describe::describe_enumerators<E>{}};

/// Reads a string and sets `index` to its position in `names`. Fails if it is not among them.
bool read_choice(json_reader& r, std::span<const std::string_view> names, std::size_t& index);

} // namespace detail

template <detail::described_enum T>
struct converter<T> {
    static void write(json_writer& w, T value) {
        using number = std::underlying_type_t<T>; // the type may have a comparison of its own
        constexpr auto& known = detail::enumerators<T>;
        for (auto i = known.count; i-- > 0;) {
            if (static_cast<number>(known.values[i]) == static_cast<number>(value)) {
                w.value(known.names[i]);
                return;
            }
        }
        cles::write_json(w, static_cast<number>(value));
    }
    static bool read(json_reader& r, T& value) {
        std::size_t index = 0;
        if (!detail::read_choice(r, detail::enumerators<T>.names, index)) {
            return false;
        }
        value = detail::enumerators<T>.values[index];
        return true;
    }
};

template <detail::described_struct T>
struct converter<T> {
    static void write(json_writer& w, const T& object) {
        w.begin_object();
        detail::write_fields(w, object, detail::fields_of<T>{});
        w.end_object();
    }
    static bool read(json_reader& r, T& object) {
        static_assert(detail::defaults_are_fields<T>(),
                      "CLES_DEFAULTS names a member that BOOST_DESCRIBE_STRUCT does not");
        return detail::read_fields(r, std::addressof(object), detail::field_table<T>);
    }
};

} // namespace cles
