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

template <class T, class D>
constexpr member<T> member_for() {
    using field = std::remove_cvref_t<decltype(std::declval<T&>().*D::pointer)>;
    return {D::name, [](json_reader& r, T& object) { return read_json(r, object.*D::pointer); }, !is_optional<field>};
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
