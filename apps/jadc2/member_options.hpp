// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "client/member_key.hpp"

#include <string>

namespace jadc2 {

/// These options, with the key in that directory, and its name; unchanged if there is no directory.
inline cles::service_options with_key(const std::string& keys, cles::service_options options) {
    if (!keys.empty()) {
        tool::use_member_key(options, keys);
    }
    return options;
}

} // namespace jadc2
