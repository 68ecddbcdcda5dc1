// SPDX-License-Identifier: BSL-1.0
#include "core/group_intake.hpp"

#include <cles/json_reader.hpp>

namespace cles::core {

void group_intake::solicited(bool by_name, time_point now) {
    if (presence_ != nullptr) {
        presence_->on_solicitation(by_name, now);
    }
}

bool group_intake::take(const group_source& from, const protocol::request_line& update, time_point now) {
    using verdict = publisher_sources::verdict;
    const auto& noun = update.noun;
    if (noun.task == "cles") {
        return take_announcement(from, update, now);
    }
    auto& counts = node_.counts;
    if (protocol::begins_with_error(update.body) || !feeds_.wants(update) || sources_.is_foreign(from, now)) {
        ++counts.updates_dropped;
        return true;
    }
    const auto found = sources_.look(noun.target, from, now);
    if (found == verdict::another) {
        feeds_.forget(noun.target);
    }
    if (found != verdict::refused && feeds_.take(update)) {
        ++counts.updates_received;
    } else if (found == verdict::one_of_several) {
        ++counts.group_repeated;
    } else {
        ++counts.updates_dropped;
    }
    return true;
}

bool group_intake::take_announcement(const group_source& from, const protocol::request_line& update, time_point now) {
    if (!update.noun.parameters.empty() || !is_valid_json(update.body, node_.bounds.depth)) {
        return false;
    }
    if (presence_ != nullptr) {
        presence_->on_announcement(from, update, now);
    }
    return true;
}

} // namespace cles::core
