// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/observer.hpp"

#include <boost/describe/enum_to_string.hpp>

#include <algorithm>
#include <utility>

namespace platoon {

std::optional<event> observer::take(const std::string& from, const state& told, double now) {
    if (!implausible(told, law_).empty()) {
        return std::nullopt;
    }
    const auto* const last = book_.last(from);
    const bool returns = silent_.erase(from) != 0;
    const bool changed = last != nullptr && (last->mode != told.mode || returns);
    if (returns) {
        book_.record_return(from);
    }
    heard_[from] = now;
    book_.add(from, told);
    if (!changed) {
        return std::nullopt;
    }
    return event{.t = now, .vehicle = from, .mode = boost::describe::enum_to_string(told.mode, "")};
}

std::vector<event> observer::end_silent(double now, double longest, const std::set<std::string>& except) {
    std::vector<event> events;
    for (const auto& [name, at] : heard_) {
        if (now - at > longest && !book_.has_ended(name) && !except.contains(name)) {
            const bool left = book_.last(name)->mode == role::leave;
            book_.record_end(name, left);
            silent_.insert(name);
            events.push_back({.t = now, .vehicle = name, .mode = left ? "left" : "silent"});
        }
    }
    return events;
}

std::vector<std::string> observer::vehicles() const {
    std::vector<std::string> names;
    names.reserve(heard_.size());
    for (const auto& [name, at] : heard_) {
        names.push_back(name);
    }
    return names;
}

std::vector<std::string> observer::lane(double t) const {
    std::vector<std::pair<double, std::string>> there;
    for (const auto& [name, at] : heard_) {
        if (const auto where = book_.position(name, t)) {
            there.emplace_back(-where->x, name);
        }
    }
    std::sort(there.begin(), there.end());
    std::vector<std::string> names;
    names.reserve(there.size());
    for (auto& [place, name] : there) {
        names.push_back(std::move(name));
    }
    return names;
}

std::vector<double> observer::desired(const std::vector<std::string>& lane, double spacing, double speed) const {
    std::vector<double> distances;
    for (std::size_t i = 0; i < lane.size(); ++i) {
        distances.push_back(
            i == 0 ? 0 : wanted_distance(spacing, speed, book_.last(lane[i])->brake, book_.last(lane[i - 1])->brake));
    }
    return distances;
}

} // namespace platoon
