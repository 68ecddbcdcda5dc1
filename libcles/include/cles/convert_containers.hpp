// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

/// Conversion of the standard containers; included by `<cles/convert.hpp>`.

namespace cles {

namespace detail {

template <class Sequence>
bool read_elements(json_reader& r, Sequence& out) {
    out.clear();
    if (!r.begin_array()) {
        return false;
    }
    while (r.next_element()) {
        if (!cles::read_json(r, out.emplace_back())) {
            r.inside_element(out.size() - 1);
            return false;
        }
    }
    return r.ok();
}

template <>
struct map_key<std::string> {
    static const std::string& text(const std::string& key) noexcept { return key; }
    static bool read(json_reader&, std::string_view text, std::string& key) {
        key = text;
        return true;
    }
};

/// False if the text is not an integer as it is written, or out of range.
bool read_integer_key(json_reader& r, std::string_view text, std::int64_t& key);
bool read_integer_key(json_reader& r, std::string_view text, std::uint64_t& key);

template <whole Key>
struct map_key<Key> {
    static std::string text(Key key) { return std::to_string(static_cast<widest<Key>>(key)); }
    static bool read(json_reader& r, std::string_view text, Key& key) {
        widest<Key> number{};
        if (!read_integer_key(r, text, number)) {
            return false;
        }
        key = static_cast<Key>(number);
        return detail::fits<Key>(number) || r.fail("the key is out of range");
    }
};

template <class Map>
void write_members(json_writer& w, const Map& values) {
    w.begin_object();
    for (const auto& member : values) { // a structured binding would call `get` of the namespace of the values
        w.key(map_key<typename Map::key_type>::text(member.first));
        cles::write_json(w, member.second);
    }
    w.end_object();
}

template <class Map>
bool read_members(json_reader& r, Map& values) {
    values.clear();
    if (!r.begin_object()) {
        return false;
    }
    using key_type = typename Map::key_type;
    std::string_view text;
    while (r.next_key(text)) {
        key_type key{};
        if (!map_key<key_type>::read(r, text, key)) {
            r.inside_member(text);
            return false;
        }
        const auto at = values.try_emplace(std::move(key)).first;
        if (!cles::read_json(r, at->second)) {
            r.inside_member(map_key<key_type>::text(at->first));
            return false;
        }
    }
    return r.ok();
}

bool fail_count(json_reader& r, std::string_view which, std::size_t wanted);

/// A tuple or pair as an array of that length.
template <class Tuple>
struct fixed_elements {
    static void write(json_writer& w, const Tuple& values) {
        w.begin_array();
        std::apply([&w](const auto&... value) { (cles::write_json(w, value), ...); }, values);
        w.end_array();
    }
    static bool read(json_reader& r, Tuple& values) {
        constexpr std::size_t count = std::tuple_size_v<Tuple>;
        std::size_t next = 0;
        const auto read_one = [&](auto& value) {
            if (!r.next_element()) {
                return r.ok() && fail_count(r, "fewer", count);
            }
            if (!cles::read_json(r, value)) {
                r.inside_element(next);
                return false;
            }
            ++next;
            return true;
        };
        return r.begin_array() && std::apply([&](auto&... value) { return (read_one(value) && ...); }, values) &&
               (!r.next_element() ? r.ok() : fail_count(r, "more", count));
    }
};

} // namespace detail

template <class T, class A>
struct converter<std::vector<T, A>> {
    using parts = detail::types<T>;
    static void write(json_writer& w, const std::vector<T, A>& values) {
        w.begin_array();
        for (const auto& value : values) {
            cles::write_json<T>(w, value);
        }
        w.end_array();
    }
    static bool read(json_reader& r, std::vector<T, A>& values) { return detail::read_elements(r, values); }
};

template <class A>
struct converter<std::vector<bool, A>> {
    using parts = detail::types<bool>;
    static void write(json_writer& w, const std::vector<bool, A>& values) {
        w.begin_array();
        for (const bool value : values) {
            w.value(value);
        }
        w.end_array();
    }
    static bool read(json_reader& r, std::vector<bool, A>& values) {
        values.clear();
        if (!r.begin_array()) {
            return false;
        }
        while (r.next_element()) {
            bool value = false;
            if (!r.read(value)) {
                r.inside_element(values.size());
                return false;
            }
            values.push_back(value);
        }
        return r.ok();
    }
};

template <class T, std::size_t N>
struct converter<std::array<T, N>> {
    using parts = detail::types<T>;
    static void write(json_writer& w, const std::array<T, N>& values) {
        w.begin_array();
        for (const auto& value : values) {
            cles::write_json(w, value);
        }
        w.end_array();
    }
    static bool read(json_reader& r, std::array<T, N>& values) {
        if (!r.begin_array()) {
            return false;
        }
        std::size_t count = 0;
        while (r.next_element()) {
            if (count == N) {
                return detail::fail_count(r, "more", N);
            }
            if (!cles::read_json(r, values[count])) {
                r.inside_element(count);
                return false;
            }
            ++count;
        }
        return r.ok() && (count == N || detail::fail_count(r, "fewer", N));
    }
};

/// Keys that are not text are written as text: {"17":...}.
template <detail::usable_as_key Key, class T, class C, class A>
struct converter<std::map<Key, T, C, A>> {
    using map = std::map<Key, T, C, A>;
    using parts = detail::types<T>;
    static void write(json_writer& w, const map& values) { detail::write_members(w, values); }
    static bool read(json_reader& r, map& values) { return detail::read_members(r, values); }
};

/// Members are written in unspecified order.
template <detail::usable_as_key Key, class T, class H, class E, class A>
struct converter<std::unordered_map<Key, T, H, E, A>> {
    using map = std::unordered_map<Key, T, H, E, A>;
    using parts = detail::types<T>;
    static void write(json_writer& w, const map& values) { detail::write_members(w, values); }
    static bool read(json_reader& r, map& values) { return detail::read_members(r, values); }
};

template <class... T>
struct converter<std::tuple<T...>> : detail::fixed_elements<std::tuple<T...>> {
    using parts = detail::types<T...>;
};

template <class T, class U>
struct converter<std::pair<T, U>> : detail::fixed_elements<std::pair<T, U>> {
    using parts = detail::types<T, U>;
};

} // namespace cles
