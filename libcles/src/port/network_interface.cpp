// SPDX-License-Identifier: BSL-1.0
#include "port/network_interface.hpp"

#include <algorithm>

namespace cles::core {

std::vector<network_interface> automatic(std::vector<network_interface> all) {
    std::erase_if(all, [](const network_interface& each) {
        return !each.running || each.address == 0 || each.point_to_point || !(each.multicast || each.loopback);
    });
    std::stable_partition(all.begin(), all.end(), [](const network_interface& each) { return each.loopback; });
    return all;
}

} // namespace cles::core
