// SPDX-License-Identifier: BSL-1.0
#include "node/publish/group_dispatcher.hpp"

#include <cles/json_reader.hpp>

#include "node/membership/membership.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

void group_dispatcher::solicited(bool by_name, time_point now) {
    if (listener_ != nullptr) {
        listener_->on_solicitation(by_name, now);
    }
}

bool group_dispatcher::take(const group_source& from, const protocol::request_line& update, time_point now) {
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

bool group_dispatcher::take_announcement(const group_source& from, const protocol::request_line& update,
                                         time_point now) {
    if (!update.noun.parameters.empty() || !is_valid_json(update.body, node_.bounds.depth)) {
        return false;
    }
    if (listener_ != nullptr) {
        listener_->on_announcement(from, update, now);
    }
    return true;
}

publisher_sources::verdict publisher_sources::look(std::string_view node, const group_source& from, time_point now) {
    if (const auto* const run = others_.announced(node)) {
        return !run->sends_from(from)           ? verdict::refused
               : run->announced.sources.empty() ? verdict::taken
                                                : verdict::one_of_several;
    }
    if (const auto found = source_bindings_.find(node); found != source_bindings_.end()) {
        const bool same = found->second.to == from;
        if (!same && now - found->second.heard < silent_after) {
            return verdict::refused;
        }
        found->second = {from, now};
        return same ? verdict::taken : verdict::another;
    }
    if (source_bindings_.size() >= max_entries_ && !source_bindings_.empty()) {
        source_bindings_.erase(
            std::min_element(source_bindings_.begin(), source_bindings_.end(),
                             [](const auto& a, const auto& b) { return a.second.heard < b.second.heard; }));
    }
    source_bindings_.emplace(std::string{node}, source_binding{from, now});
    return verdict::taken;
}

void publisher_sources::note_foreign(const group_source& from, time_point until) {
    if (foreign_.size() >= max_entries_ && !foreign_.contains(from)) {
        foreign_.erase(std::min_element(foreign_.begin(), foreign_.end(),
                                        [](const auto& a, const auto& b) { return a.second < b.second; }));
    }
    if (max_entries_ != 0) {
        foreign_.insert_or_assign(from, until);
    }
}

} // namespace cles::core
