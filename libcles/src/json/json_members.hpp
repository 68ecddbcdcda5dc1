// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace cles::core {

/// Reads an object: calls `member` with the name of each member (valid until it reads), which reads or skips the value.
/// False if `member` returns false, or if this is not an object.
template <class Member>
bool read_members(json_reader& r, Member&& member) {
    if (!r.begin_object()) {
        return false;
    }
    std::string_view key;
    while (r.next_key(key)) {
        if (!member(key)) {
            return false;
        }
    }
    return r.ok();
}

/// Reads an array of strings: passes each to `take`, valid during the call. False if this is anything else.
template <class F>
bool read_texts(json_reader& r, F&& take) {
    if (!r.begin_array()) {
        return false;
    }
    while (r.next_element()) {
        std::string_view text;
        if (!r.read(text)) {
            return false;
        }
        take(text);
    }
    return r.ok();
}

/// Begins the next member of an object whose members are collected without its braces. Its value follows, as JSON.
inline void begin_member(std::string& members, std::string_view name) {
    if (!members.empty()) {
        members.push_back(',');
    }
    json_writer{members}.key(name);
}

/// Writes a member of an object: text, a number, a flag or an array of texts. Its name needs no escapes.
template <class T>
void write_member(json_writer& w, std::string_view name, const T& value) {
    w.plain_key(name);
    if constexpr (std::is_convertible_v<const T&, std::string_view>) {
        w.value(std::string_view{value});
    } else if constexpr (std::is_base_of_v<std::vector<std::string>, T>) {
        w.begin_array();
        for (const auto& each : value) {
            w.value(std::string_view{each});
        }
        w.end_array();
    } else if constexpr (std::is_unsigned_v<T> && !std::is_same_v<T, bool>) {
        w.value(std::uint64_t{value});
    } else {
        w.value(value);
    }
}

} // namespace cles::core
