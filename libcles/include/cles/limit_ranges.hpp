// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>
#include <cles/limits.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>

namespace cles {

/// A member of `limits` that is a count or a number of bytes, and its range.
struct count_range {
    std::string_view name;
    std::size_t limits::*member;
    std::size_t least;
    std::size_t most;
};

/// A member of `limits` that is a time, and its range.
struct time_range {
    std::string_view name;
    std::chrono::milliseconds limits::*member;
    std::chrono::milliseconds least;
    std::chrono::milliseconds most;
};

namespace detail {

inline constexpr std::size_t kibi = 1U << 10U;
inline constexpr std::size_t mebi = 1U << 20U;
inline constexpr std::size_t gibi = 1U << 30U;
inline constexpr std::size_t many = 1'000'000;
inline constexpr std::size_t most_memory =
    static_cast<std::size_t>(std::min<std::uint64_t>(std::uint64_t{1} << 40U, std::numeric_limits<std::size_t>::max()));
inline constexpr std::chrono::milliseconds instant{1};
inline constexpr std::chrono::milliseconds day = std::chrono::hours{24};

} // namespace detail

/// All members of `limits`, for programs that read them, for example from a file.
inline constexpr std::array<count_range, 17> count_ranges{{
    {"line", &limits::line, 256, 64 * detail::mebi},
    {"depth", &limits::depth, 1, 64},
    {"links", &limits::links, 1, detail::many},
    {"links_per_address", &limits::links_per_address, 0, detail::many},
    {"in_flight", &limits::in_flight, 1, detail::many},
    {"bindings", &limits::bindings, 1, detail::many},
    {"nouns", &limits::nouns, 1, detail::many},
    {"running", &limits::running, 1, detail::many},
    {"unread", &limits::unread, 1, detail::gibi},
    {"waiting", &limits::waiting, 1, detail::gibi},
    {"binding_bytes", &limits::binding_bytes, detail::kibi, detail::gibi},
    {"remembered", &limits::remembered, detail::kibi, detail::gibi},
    {"peers", &limits::peers, 1, detail::many},
    {"group_leases", &limits::group_leases, 1, detail::many},
    {"publishers", &limits::publishers, 1, detail::many},
    {"feed", &limits::feed, 1, detail::many},
    {"memory", &limits::memory, 64 * detail::kibi, detail::most_memory},
}};

inline constexpr std::array<time_range, 7> time_ranges{{
    {"stall", &limits::stall, detail::instant, detail::day},
    {"lease", &limits::lease, std::chrono::milliseconds{20}, std::chrono::minutes{1}},
    {"connect", &limits::connect, detail::instant, detail::day},
    {"discard", &limits::discard, detail::instant, detail::day},
    {"first_line", &limits::first_line, std::chrono::milliseconds{0}, detail::day},
    {"probe", &limits::probe, detail::instant, detail::day},
    {"silence", &limits::silence, std::chrono::milliseconds{0}, detail::day},
}};

/// \throws cles::error with `invalid_option`, naming the first member that is out of range
void check(const limits& bounds);

} // namespace cles
