// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace cles::simulation {

/// What has to hold, whatever happens (README.md of this folder).
enum class rule : std::uint8_t {
    effects_once,  ///< PUSH, DELEGATE and UPDATE run at most once
    ends_in_time,  ///< every request ends once, by its deadline
    reply_order,   ///< anonymous requests are answered in their order
    update_order,  ///< a binder sees each update at most once, in order, and only what was published
    gaps_told,     ///< what a binder saw and what it was told that it missed are all there was
    replies_match, ///< an answer is that to its request, and true
    well_formed,   ///< what crosses the network is a message of its size
    bounded,       ///< memory stays within the limits
    at_rest,       ///< nothing is kept when all is quiet
    asks_succeed,  ///< once the trouble is over, requests succeed
    feeds_receive, ///< once the trouble is over, feeds are bound and receive
    others_known,  ///< once the trouble is over, all know all who are there, and nobody else
    nobody_lost,   ///< who was heard of late is not taken for silent, gone, or another one
    gone_in_time,  ///< who is silent is suspect and gone in time, who leaves at once
    clashes_told,  ///< a second live node of a name is reported, and has not the name
    sent_once,     ///< the group gets each update once, and again only for a new binder
    first_soon,    ///< who binds by the group soon gets the last update
    same_trace,    ///< a seed always gives the same
};

inline constexpr std::array<std::string_view, 18> rule_names{
    "effects_once", "ends_in_time", "reply_order",  "update_order", "gaps_told",     "replies_match",
    "well_formed",  "bounded",      "at_rest",      "asks_succeed", "feeds_receive", "others_known",
    "nobody_lost",  "gone_in_time", "clashes_told", "sent_once",    "first_soon",    "same_trace"};

constexpr std::string_view to_string(rule r) noexcept { return rule_names[static_cast<std::size_t>(r)]; }

} // namespace cles::simulation
