// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace cles::core {

/// What came of asking a run of a node whether it is there.
struct probe_outcome {
    enum class kind : std::uint8_t {
        answered, ///< by a node: what follows says which
        absent,   ///< refused, or silent for too long
        unclear,  ///< somebody is there who does not say who he is, or this node could not ask
    };
    kind what = kind::unclear;
    std::string node{};
    std::uint32_t epoch = 0;
    std::chrono::milliseconds uptime{0};
};

/// Reads the reply of `PULL self:cles`; what cannot be read is unclear.
probe_outcome read_probe_answer(std::string_view json);

/// How far it is known which of two runs of one name is there.
struct name_check {
    enum class stage : std::uint8_t { none, owner, rival, over };
    stage at = stage::none;
    std::uint64_t ticket = 0;
    time_point asked{};
    time_point owner_began{};
    bool confirmed = false; // both have answered
};

} // namespace cles::core
