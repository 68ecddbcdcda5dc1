// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_reader.hpp>

#include <string_view>

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

} // namespace cles::core
