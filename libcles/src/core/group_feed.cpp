// SPDX-License-Identifier: BSL-1.0
#include "core/group_feed.hpp"

#include "core/update_intake.hpp"

#include <algorithm>

namespace cles::core {

group_feed::source& group_feed::known(std::string_view name) {
    if (const auto found = publishers_.find(name); found != publishers_.end()) {
        return found->second;
    }
    if (publishers_.size() >= most_publishers_) {
        publishers_.erase(std::min_element(publishers_.begin(), publishers_.end(), [](const auto& a, const auto& b) {
            return a.second.heard < b.second.heard;
        }));
    }
    return publishers_[std::string{name}];
}

bool group_feed::take(const protocol::request_line& update) {
    auto& from = known(update.noun.target);
    from.heard = ++heard_;
    return take_in(from.order, update, false, [this](const detail::raw_event& event) { return mail_.put(event); });
}

} // namespace cles::core
