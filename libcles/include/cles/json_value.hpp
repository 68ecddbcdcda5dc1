// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <boost/json/value.hpp>

#include <string_view>

namespace cles {

/// `boost::json::value` as an argument or result of handlers that need a tree. Doubles are read and written by the
/// library's own reader and writer, so they round-trip exactly.
template <>
struct converter<boost::json::value> {
    static void write(json_writer& w, const boost::json::value& value);
    static bool read(json_reader& r, boost::json::value& value);
};

template <>
struct converter<boost::json::object> {
    static constexpr std::string_view schema = R"({"type":"object"})"; ///< for <cles/types.hpp>
    static void write(json_writer& w, const boost::json::object& value);
    static bool read(json_reader& r, boost::json::object& value);
};

template <>
struct converter<boost::json::array> {
    static constexpr std::string_view schema = R"({"type":"array"})";
    static void write(json_writer& w, const boost::json::array& value);
    static bool read(json_reader& r, boost::json::array& value);
};

} // namespace cles
