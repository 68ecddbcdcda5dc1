// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

/// Conversion of the standard containers; comes with `<cles/convert.hpp>`.

namespace cles {

namespace detail {

template <class Sequence>
bool read_elements(json_reader& r, Sequence& out) {
    out.clear();
    if (!r.begin_array()) {
        return false;
    }
    while (r.next_element()) {
        if (!read_json(r, out.emplace_back())) {
            r.inside_element(out.size() - 1);
            return false;
        }
    }
    return r.ok();
}

} // namespace detail

template <class T, class A>
struct converter<std::vector<T, A>> {
    static void write(json_writer& w, const std::vector<T, A>& values) {
        w.begin_array();
        for (const auto& value : values) {
            write_json<T>(w, value);
        }
        w.end_array();
    }
    static bool read(json_reader& r, std::vector<T, A>& values) { return detail::read_elements(r, values); }
};

template <class A>
struct converter<std::vector<bool, A>> {
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
    static void write(json_writer& w, const std::array<T, N>& values) {
        w.begin_array();
        for (const auto& value : values) {
            write_json(w, value);
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
                return r.fail("more than " + std::to_string(N) + " elements");
            }
            if (!read_json(r, values[count])) {
                r.inside_element(count);
                return false;
            }
            ++count;
        }
        return r.ok() && (count == N || r.fail("fewer than " + std::to_string(N) + " elements"));
    }
};

template <class T, class C, class A>
struct converter<std::map<std::string, T, C, A>> {
    static void write(json_writer& w, const std::map<std::string, T, C, A>& values) {
        w.begin_object();
        for (const auto& [name, value] : values) {
            w.key(name);
            write_json(w, value);
        }
        w.end_object();
    }
    static bool read(json_reader& r, std::map<std::string, T, C, A>& values) {
        values.clear();
        if (!r.begin_object()) {
            return false;
        }
        std::string_view key;
        while (r.next_key(key)) {
            const auto at = values.try_emplace(std::string{key}).first;
            if (!read_json(r, at->second)) {
                r.inside_member(at->first);
                return false;
            }
        }
        return r.ok();
    }
};

} // namespace cles
