// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/container_hash/hash.hpp>
#include <boost/unordered/unordered_flat_map.hpp>

#include <functional>
#include <string>
#include <string_view>

namespace cles::core {

struct string_hash : boost::hash<std::string_view> {
    using is_transparent = void;
};

/// A map with text keys. Lookups do not create a string.
template <class V>
using string_map = boost::unordered_flat_map<std::string, V, string_hash, std::equal_to<>>;

} // namespace cles::core
