// SPDX-License-Identifier: BSL-1.0
#include "config/config_limits.hpp"

#include <cles/limit_ranges.hpp>

#include "config/config_node.hpp"

#include <chrono>
#include <cstddef>

namespace cles::runtime {
namespace {

constexpr std::size_t most_links = 20'000; // each is a file descriptor, of which a process has fewer

std::size_t most_of(const count_range& range) {
    return range.member == &limits::links || range.member == &limits::links_per_address ? most_links : range.most;
}

std::chrono::milliseconds to_milliseconds(const std::string& text, const time_range& range) {
    // Rounded up: 0 turns some limits off, and what is not 0 must not.
    const auto span = std::chrono::ceil<std::chrono::milliseconds>(to_duration(text));
    const auto bound = [](std::chrono::milliseconds at) { return to_string(std::chrono::microseconds{at}); };
    if (span < range.least) {
        throw bad_value("'" + text + "' is too short: " + bound(range.least) + " at least");
    }
    if (span > range.most) {
        throw bad_value("'" + text + "' is too long: " + bound(range.most) + " at most");
    }
    return span;
}

} // namespace

void read_limits(const config_node& from, limits& over) {
    config_node::readers known;
    for (const auto& range : count_ranges) {
        known.emplace(range.name, [&over, &range](const config_node& v) {
            over.*range.member = v.as([&](const std::string& text) {
                return static_cast<std::size_t>(to_size(text, range.least, most_of(range)));
            });
        });
    }
    for (const auto& range : time_ranges) {
        known.emplace(range.name, [&over, &range](const config_node& v) {
            over.*range.member = v.as([&](const std::string& text) { return to_milliseconds(text, range); });
        });
    }
    from.map(known);
}

std::string limits_text(const limits& bounds, const std::string& indent) {
    std::string text;
    for (const auto& range : count_ranges) {
        text.append(indent).append(range.name) += ": " + std::to_string(bounds.*range.member) + "\n";
    }
    for (const auto& range : time_ranges) {
        text.append(indent).append(range.name) +=
            ": " + to_string(std::chrono::microseconds{bounds.*range.member}) + "\n";
    }
    return text;
}

} // namespace cles::runtime
