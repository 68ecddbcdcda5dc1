// SPDX-License-Identifier: BSL-1.0
#include <cles/gossip.hpp>

#include "shell/gossip_part.hpp"
#include "shell/gossiper.hpp"

#include <memory>
#include <utility>

namespace cles {

gossip_options gossip(std::vector<std::string> seeds) {
    static constexpr detail::gossip_part part{
        [](shell::local_node& node, std::uint32_t seed) -> std::unique_ptr<detail::gossip_host> {
            return std::make_unique<shell::gossiper>(node, seed);
        }};
    return {.seeds = std::move(seeds), .part = &part};
}

} // namespace cles
