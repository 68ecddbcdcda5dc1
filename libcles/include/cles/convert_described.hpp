// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <boost/describe.hpp>
#include <boost/mp11/algorithm.hpp>
#include <boost/mp11/list.hpp>

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

/// Conversion of structs and enums that are described with Boost.Describe; comes with `<cles/convert.hpp>`.

/// Names members that may be missing from what is read: they keep what their initialisers give. So a message can grow
/// without refusing those of older senders. It stands behind the description of the struct, in the struct's namespace
/// (or in the struct, behind `friend`):
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

template <class T>
using members_of = boost::describe::describe_members<T, boost::describe::mod_public | boost::describe::mod_inherited>;

template <class T>
inline constexpr bool is_optional = false;
template <class T>
inline constexpr bool is_optional<std::optional<T>> = true;

template <class T>
struct member {
    std::string_view name;
    bool (*read)(json_reader&, T&);
    bool required;
};

template <class M, class C>
C class_of(M C::*);

template <class C>
concept has_defaults = requires {
    cles_members_with_defaults(static_cast<const C*>(nullptr));
};

/// Takes the next name off a list as "(lat, lon)".
constexpr std::string_view next_name(std::string_view& list) noexcept {
    constexpr std::string_view between = "(), ";
    while (!list.empty() && between.find(list.front()) != std::string_view::npos) {
        list.remove_prefix(1);
    }
    const auto name = list.substr(0, list.find_first_of(between));
    list.remove_prefix(name.size());
    return name;
}

/// Whether the class that declares a member, or one that inherits it, gives it a default.
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
constexpr member<T> member_for() {
    using field = std::remove_cvref_t<decltype(std::declval<T&>().*D::pointer)>;
    using owner = decltype(class_of(D::pointer));
    return {D::name, [](json_reader& r, T& object) { return read_json(r, object.*D::pointer); },
            !is_optional<field> && !has_default<owner>(D::name) && !has_default<T>(D::name)};
}

template <class T, class... D>
constexpr std::array<member<T>, sizeof...(D)> table_of(boost::mp11::mp_list<D...>) {
    return {member_for<T, D>()...};
}

template <class D>
inline constexpr prepared_key_text<std::string_view{D::name}.size()> key_of{D::name};

template <class Table>
constexpr std::size_t find_member(const Table& table, std::string_view name) noexcept {
    std::size_t i = 0;
    while (i < table.size() && table[i].name != name) {
        ++i;
    }
    return i;
}

template <class T>
inline constexpr auto member_table = table_of<T>(boost::mp11::mp_rename<members_of<T>, boost::mp11::mp_list>{});

template <class T>
constexpr bool defaults_are_members() noexcept {
    if constexpr (has_defaults<T>) {
        auto list = cles_members_with_defaults(static_cast<const T*>(nullptr));
        for (auto name = next_name(list); !name.empty(); name = next_name(list)) {
            if (find_member(member_table<T>, name) == member_table<T>.size()) {
                return false;
            }
        }
    }
    return true;
}

} // namespace detail

template <detail::described_enum T>
struct converter<T> {
    static void write(json_writer& w, T value) {
        const char* name = boost::describe::enum_to_string(value, nullptr);
        if (name != nullptr) {
            w.value(std::string_view{name});
        } else {
            write_json(w, static_cast<std::underlying_type_t<T>>(value));
        }
    }
    static bool read(json_reader& r, T& value) {
        std::string_view name;
        if (!r.read(name)) {
            return false;
        }
        std::string choices;
        bool found = false;
        boost::mp11::mp_for_each<boost::describe::describe_enumerators<T>>([&](auto d) {
            if (name == d.name) {
                value = d.value;
                found = true;
            }
            choices.append(choices.empty() ? "" : ", ").append(d.name);
        });
        return found || r.fail("expected one of " + choices);
    }
};

template <detail::described_struct T>
struct converter<T> {
    static void write(json_writer& w, const T& object) {
        w.begin_object();
        boost::mp11::mp_for_each<detail::members_of<T>>([&](auto d) {
            const auto& field = object.*d.pointer;
            if constexpr (detail::is_optional<std::remove_cvref_t<decltype(field)>>) {
                if (field) {
                    w.plain_key(detail::key_of<decltype(d)>);
                    write_json(w, *field);
                }
            } else {
                w.plain_key(detail::key_of<decltype(d)>);
                write_json(w, field);
            }
        });
        w.end_object();
    }

    static bool read(json_reader& r, T& object) {
        static_assert(detail::defaults_are_members<T>(),
                      "CLES_DEFAULTS names a member that BOOST_DESCRIBE_STRUCT does not");
        constexpr auto& table = detail::member_table<T>;
        std::array<bool, table.size()> seen{};
        std::size_t next = 0; // members mostly come in their order
        std::string_view key;
        if (!r.begin_object()) {
            return false;
        }
        for (;;) {
            if (next < table.size() && r.next_key_is(table[next].name)) {
                // as expected
            } else if (!r.next_key(key)) {
                break;
            } else {
                next = detail::find_member(table, key);
            }
            if (next == table.size()) {
                if (!r.skip()) {
                    return false;
                }
                continue;
            }
            if (!table[next].read(r, object)) {
                r.inside_member(table[next].name);
                return false;
            }
            seen[next++] = true;
        }
        if (!r.ok()) {
            return false;
        }
        for (std::size_t i = 0; i < table.size(); ++i) {
            if (!seen[i] && table[i].required) {
                r.fail("is missing");
                r.inside_member(table[i].name);
                return false;
            }
        }
        return true;
    }
};

} // namespace cles
