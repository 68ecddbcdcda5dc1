// SPDX-License-Identifier: BSL-1.0
#include "core/group_welcomes.hpp"

#include "core/later.hpp"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

namespace cles::core {

std::list<group_welcomes::waiting>::iterator group_welcomes::find(const group_source& from, std::string_view path) {
    return std::find_if(waiting_.begin(), waiting_.end(), [&](const waiting& w) {
        std::string scratch;
        return w.from == from && protocol::canonical_path(w.bind->noun, scratch) == path;
    });
}

bool group_welcomes::ask(const group_source& from, const identity& peer, const protocol::request_line& bind,
                         time_point now) {
    std::string scratch;
    if (find(from, protocol::canonical_path(bind.noun, scratch)) != waiting_.end()) {
        return true;
    }
    if (waiting_.size() >= most) {
        return false;
    }
    const auto place = waiting_.emplace(waiting_.end(), from, peer, bind);
    const auto decision = std::make_shared<bind_decision>(node_, [this, place](const protocol::failure* why_not) {
        std::list<waiting> decided; // which may ask again at once
        decided.splice(decided.end(), waiting_, place);
        if (why_not == nullptr) { // otherwise there is nobody to tell
            welcome_(place->from, *place->bind);
        }
    });
    place->decision = decision;
    decision->ask(*place->bind, place->peer, later(now, std::chrono::milliseconds{bind.deadline_ms}), now);
    return true;
}

void group_welcomes::drop(const group_source& from, const protocol::request_line& bind) {
    std::string scratch;
    const auto found = find(from, protocol::canonical_path(bind.noun, scratch));
    if (found != waiting_.end()) {
        std::list<waiting> gone;
        gone.splice(gone.end(), waiting_, found);
        gone.front().decision->withdraw();
    }
}

void group_welcomes::clear() {
    auto gone = std::exchange(waiting_, {});
    for (const auto& each : gone) {
        each.decision->withdraw();
    }
}

} // namespace cles::core
