// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/container_hash/hash.hpp>
#include <boost/unordered/unordered_flat_map.hpp>

#include <functional>
#include <string>
#include <string_view>

namespace cles::core {

struct text_hash : boost::hash<std::string_view> {
    using is_transparent = void;
};

/// Values by text. Finding one makes no string.
template <class V>
using text_map = boost::unordered_flat_map<std::string, V, text_hash, std::equal_to<>>;

} // namespace cles::core
