// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "client/member_key.hpp"

#include <string>

namespace jadc2 {

/// Options of a service with the key in that directory, and its name; without a directory, with this name.
inline cles::service_options options_of_member(const std::string& name, const std::string& keys) {
    cles::service_options out;
    if (keys.empty()) {
        out.name = name;
    } else {
        tool::use_member_key(out, keys);
    }
    return out;
}

} // namespace jadc2
