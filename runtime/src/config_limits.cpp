// SPDX-License-Identifier: BSL-1.0
#include "config_limits.hpp"

#include "config_node.hpp"

#include <array>
#include <chrono>
#include <cstdint>

namespace cles::runtime {
namespace {

struct count_limit {
    const char* key;
    std::size_t limits::*member;
    std::uint64_t least;
    std::uint64_t most;
};

constexpr std::uint64_t mebi = 1U << 20U;

constexpr std::array<count_limit, 16> counts{{
    {"line", &limits::line, 1024, 64 * mebi},
    {"depth", &limits::depth, 1, 64},
    {"links", &limits::links, 1, 20'000},
    {"links_per_address", &limits::links_per_address, 0, 20'000},
    {"in_flight", &limits::in_flight, 1, 1'000'000},
    {"bindings", &limits::bindings, 1, 1'000'000},
    {"nouns", &limits::nouns, 1, 1'000'000},
    {"running", &limits::running, 1, 1'000'000},
    {"unread", &limits::unread, 1024, 1024 * mebi},
    {"waiting", &limits::waiting, 1024, 1024 * mebi},
    {"binding_bytes", &limits::binding_bytes, 1024, 1024 * mebi},
    {"remembered", &limits::remembered, 1024, 1024 * mebi},
    {"peers", &limits::peers, 1, 100'000},
    {"group_leases", &limits::group_leases, 1, 1'000'000},
    {"publishers", &limits::publishers, 1, 1'000'000},
    {"feed", &limits::feed, 1, 1'000'000},
}};

struct span_limit {
    const char* key;
    std::chrono::milliseconds limits::*member;
};

constexpr std::array<span_limit, 6> spans{{{"stall", &limits::stall},
                                           {"lease", &limits::lease},
                                           {"connect", &limits::connect},
                                           {"discard", &limits::discard},
                                           {"first_line", &limits::first_line},
                                           {"probe", &limits::probe}}};

std::chrono::milliseconds to_milliseconds(const std::string& text) {
    const auto span = std::chrono::duration_cast<std::chrono::milliseconds>(to_duration(text));
    if (span.count() < 1) {
        throw bad_value("'" + text + "' is too short: a millisecond at least");
    }
    return span;
}

} // namespace

void read_limits(const config_node& from, limits& over) {
    config_node::readers known;
    for (const auto& limit : counts) {
        known.emplace(limit.key, [&over, &limit](const config_node& v) {
            over.*limit.member = v.as([&](const std::string& text) { return to_size(text, limit.least, limit.most); });
        });
    }
    for (const auto& limit : spans) {
        known.emplace(limit.key, [&over, &limit](const config_node& v) { over.*limit.member = v.as(to_milliseconds); });
    }
    from.map(known);
}

std::string limits_text(const limits& bounds, const std::string& indent) {
    std::string text;
    for (const auto& limit : counts) {
        text += indent + limit.key + ": " + std::to_string(bounds.*limit.member) + "\n";
    }
    for (const auto& limit : spans) {
        text += indent + limit.key + ": " + to_string(std::chrono::microseconds{bounds.*limit.member}) + "\n";
    }
    return text;
}

} // namespace cles::runtime
