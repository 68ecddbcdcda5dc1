// SPDX-License-Identifier: BSL-1.0
#include "newcomers.hpp"

#include <algorithm>
#include <utility>

namespace dsgd {

std::vector<cles::peer> newcomers::among(const std::vector<cles::peer>& peers) {
    std::vector<cles::peer> out;
    for (const auto& each : peers) {
        const bool may = names_.empty() || std::find(names_.begin(), names_.end(), each.node) != names_.end();
        if (!may || each.state != cles::peer_state::live) {
            continue;
        }
        if (const auto member = members_.find(each.node); member != members_.end()) {
            member->second = member->second.empty() ? each.epoch : member->second;
            if (member->second == each.epoch) {
                continue;
            }
        }
        auto incarnation = each.epoch + ' ' + each.tasks;
        if (auto& asked = asked_[each.node]; asked != incarnation) {
            asked = std::move(incarnation);
            out.push_back(each);
        }
    }
    return out;
}

} // namespace dsgd
