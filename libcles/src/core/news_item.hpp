// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/peer.hpp>

#include "core/announcement.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Something to be told of a run of a node. Views and pointers are valid until the table changes.
struct news_item {
    enum class kind : std::uint8_t {
        beat,        ///< it has spoken; all else about it was told
        description, ///< all
        farewell,    ///< it has left; `said` is null
    };
    kind what = kind::description;
    std::string_view node;
    const announcement* said = nullptr;
    const std::vector<std::string>* endpoints = nullptr; ///< as they are to be passed on
    std::uint32_t epoch = 0;
    std::uint64_t seq = 0;
    time_point heard{};
    peer_state state = peer_state::live;
    std::uint64_t news = 0; ///< by which news is ordered
};

} // namespace cles::core
