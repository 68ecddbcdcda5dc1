// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_reader.hpp>

#include <string_view>

namespace cles::core {

/// Reads an object: `member` is given the name of each of its members, valid until it reads, and reads or skips what
/// that has. False where `member` says so, or where this is no object.
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

} // namespace cles::core
