// SPDX-License-Identifier: BSL-1.0
// JSON: our reader, our validation and Boost.JSON agree on what is valid and what it means; what we write is read back
// unchanged.
#include <cles/convert.hpp>
#include <cles/json_value.hpp>

#include "fuzz/fuzz.hpp"

#include <boost/describe.hpp>
#include <boost/json/parse.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace cles::fuzz {
namespace {

namespace json = boost::json;

enum class colour { red, green };
BOOST_DESCRIBE_ENUM(colour, red, green)

struct inner {
    std::string s;
    std::optional<double> d;
    std::vector<bool> flags;
};
BOOST_DESCRIBE_STRUCT(inner, (), (s, d, flags))

struct outer {
    std::optional<bool> b;
    std::optional<std::int8_t> i;
    std::optional<std::uint64_t> u;
    std::optional<float> f;
    std::optional<colour> c;
    std::optional<std::array<int, 2>> pair;
    std::map<std::string, inner> m;
    std::vector<inner> v;
    json_text any;
};
BOOST_DESCRIBE_STRUCT(outer, (), (b, i, u, f, c, pair, m, v, any))

constexpr std::size_t deepest = 32;
constexpr std::size_t bottomless = 4096;

std::size_t depth_of(const json::value& v) {
    std::size_t deepest_inside = 0;
    if (const auto* array = v.if_array()) {
        for (const auto& element : *array) {
            deepest_inside = std::max(deepest_inside, depth_of(element));
        }
    } else if (const auto* object = v.if_object()) {
        for (const auto& member : *object) {
            deepest_inside = std::max(deepest_inside, depth_of(member.value()));
        }
    } else {
        return 0;
    }
    return deepest_inside + 1;
}

/// Boost's reader is not exact: its doubles may differ in the last digits. And it reads -0 as an integer.
bool nearly_same(const json::value& ours, const json::value& theirs) {
    if (ours.kind() != theirs.kind()) {
        return ours.is_double() && ours.get_double() == 0 && theirs == 0;
    }
    if (ours.is_double()) {
        const auto a = ours.get_double();
        const auto b = theirs.get_double();
        constexpr double tiny = 1e-290; // below this, few digits are left to compare
        return a == b || std::fabs(a - b) <= 1e-12 * std::fabs(a) || (std::fabs(a) < tiny && std::fabs(b) < tiny) ||
               !std::isfinite(b);
    }
    if (ours.is_array()) {
        const auto& a = ours.get_array();
        const auto& b = theirs.get_array();
        return std::equal(a.begin(), a.end(), b.begin(), b.end(), nearly_same);
    }
    if (ours.is_object()) {
        const auto& a = ours.get_object();
        const auto& b = theirs.get_object();
        return a.size() == b.size() && std::all_of(a.begin(), a.end(), [&](const auto& member) {
                   const auto* other = b.if_contains(member.key());
                   return other != nullptr && nearly_same(member.value(), *other);
               });
    }
    return ours == theirs;
}

void check_value(std::string_view text, const json::value* theirs) {
    json::value ours;
    std::string why;
    if (!from_json(text, ours, &why)) {
        require(why.find("out of the range of a double") != std::string::npos, "valid JSON can be read", why);
        return;
    }
    require(theirs == nullptr || nearly_same(ours, *theirs), "our tree is that of Boost.JSON", text);

    const auto written = to_json(ours);
    require(is_valid_json(written), "what is written is JSON", written);
    std::string compact;
    append_compact_json(written, compact);
    require(compact == written, "what is written has no white space", written);
    // JSON does not distinguish 3.0 from 3, so the texts of the trees are compared, not their kinds of numbers.
    json::value again;
    require(from_json(written, again), "what is written can be read", written);
    require(to_json(again) == written, "it is written the same", written);
}

template <class T>
void check_type(std::string_view text) {
    T first;
    std::string why;
    if (!from_json(text, first, &why)) {
        require(why.find("(at byte ") != std::string::npos, "a refusal says where", why);
        return;
    }
    const auto written = to_json(first);
    require(is_valid_json(written), "what is written is JSON", written);
    T again;
    require(from_json(written, again, &why), "what is written can be read", why);
    require(to_json(again) == written, "it is written the same", written);
}

} // namespace

void run(std::string_view input) {
    std::string why;
    const bool valid = is_valid_json(input, bottomless, &why);
    require(valid || why.find("(at byte ") != std::string::npos, "a refusal says where", why);

    boost::system::error_code refused;
    json::parse_options options;
    options.max_depth = bottomless;
    const auto theirs = json::parse({input.data(), input.size()}, refused, {}, options);
    const bool too_great = refused == json::error::exponent_overflow;
    require(valid == !refused || (valid && too_great), "Boost.JSON agrees on what is JSON", input);

    if (valid) {
        if (!refused) {
            require(is_valid_json(input, deepest) == (depth_of(theirs) <= deepest), "the depth is counted", input);
        }
        if (is_valid_json(input, deepest)) {
            check_value(input, refused ? nullptr : &theirs);
        }
        std::string compact;
        append_compact_json(input, compact);
        require(is_valid_json(compact, bottomless), "without white space it is still JSON", compact);
    }
    check_type<outer>(input);
    check_type<inner>(input);
    check_type<std::vector<double>>(input);
    check_type<std::map<std::string, std::int64_t>>(input);
    check_type<json_text>(input);
}

} // namespace cles::fuzz
