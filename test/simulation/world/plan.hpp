// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/enum.hpp>
#include <boost/describe/enum_to_string.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cles::simulation {

/// The kinds of actions. Parts of the simulation perform them (part.hpp).
BOOST_DEFINE_FIXED_ENUM_CLASS(deed, std::uint8_t, ask, cancel, follow, hold, leave, publish, offer, talk, crash, freeze,
                              part, cut, weather, gather, namesake, depart, mute, jump, retire, roster, attack);
inline std::string_view to_string(deed what) noexcept { return boost::describe::enum_to_string(what, ""); }

/// The numbers of an action, by name.
std::span<const std::string_view> fields_of(deed what) noexcept;

/// An external event at a point in time: a request of a program, or a fault.
struct action {
    static constexpr std::size_t most_fields = 10;

    std::uint32_t at_ms = 0;
    deed what = deed::ask;
    std::array<std::uint32_t, most_fields> numbers{};

    [[nodiscard]] std::uint32_t operator[](std::string_view field) const;
    bool operator==(const action&) const = default;
};

/// The complete input of a simulation: the external events, and the seed of the network's random numbers. Two runs of a
/// plan are identical to the last byte.
struct plan {
    std::uint64_t seed = 1;
    unsigned hosts = 3;
    bool small_limits = true; ///< so that they are reached
    bool strangers = false;   ///< output to sources of datagrams is limited
    bool group = false;       ///< nodes take part in multicast
    bool secured = false;     ///< nodes are members of a fleet
    std::vector<action> actions{};

    bool operator==(const plan&) const = default;
};

/// A plan as readable text, one action a line.
std::string to_text(const plan& p);
/// \throws std::runtime_error naming the line that is not valid
plan plan_from(std::string_view text);
/// \throws std::runtime_error the same, or if the file cannot be read
plan plan_in_file(const std::string& path);

/// Makes the plan of a seed, with this number of actions; with security, there are some more.
plan make_plan(std::uint64_t seed, unsigned actions, bool secured = false);

} // namespace cles::simulation
