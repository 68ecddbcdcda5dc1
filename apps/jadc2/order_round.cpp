// SPDX-License-Identifier: BSL-1.0
#include "order_round.hpp"

namespace jadc2 {

order_round::move order_round::next(const std::vector<std::string>& candidates, double now) {
    if (now >= until_) {
        return {};
    }
    for (const auto& each : candidates) {
        if (asked_.insert(each).second) {
            return {.what = step::offer, .node = each};
        }
    }
    return {.what = asked_.empty() ? step::wait : step::end, .node = {}};
}

} // namespace jadc2
