// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/observer.hpp"

#include <boost/describe/enum_to_string.hpp>

#include <algorithm>
#include <utility>

namespace platoon {

std::optional<event> observer::take(const std::string& from, const state& told, double now) {
    if (!implausible(told, law_).empty() || !has_room_for(from)) {
        return std::nullopt;
    }
    const auto* const last = book_.last(from);
    const bool returns = silent_.erase(from) != 0;
    const bool changed = last != nullptr && (last->mode != told.mode || returns);
    if (returns) {
        book_.record_return(from);
    }
    auto& known = vehicles_[from];
    known.heard = now;
    book_.add(from, told);
    if (changed && now - known.since >= change_period) {
        known.since = now;
        known.changes = 0;
    }
    if (!changed || ++known.changes > most_changes) {
        return std::nullopt;
    }
    return event{.t = now, .vehicle = from, .mode = boost::describe::enum_to_string(told.mode, "")};
}

// Anybody may publish in the group, under any number of names.
bool observer::has_room_for(const std::string& name) {
    if (vehicles_.size() < most_vehicles || vehicles_.contains(name)) {
        return true;
    }
    const auto heard_before = [this](const std::string& a, const std::string& b) {
        return vehicles_.at(a).heard < vehicles_.at(b).heard;
    };
    const auto found = std::min_element(silent_.begin(), silent_.end(), heard_before);
    if (found == silent_.end()) {
        return false;
    }
    book_.forget(*found);
    vehicles_.erase(*found);
    silent_.erase(found);
    return true;
}

std::vector<event> observer::end_silent(double now, double longest, const std::set<std::string>& except) {
    std::vector<event> events;
    for (const auto& [name, known] : vehicles_) {
        if (now - known.heard > longest && !book_.has_ended(name) && !except.contains(name)) {
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
    names.reserve(vehicles_.size());
    for (const auto& [name, known] : vehicles_) {
        names.push_back(name);
    }
    return names;
}

std::vector<std::string> observer::lane(double t) const {
    std::vector<std::pair<double, std::string>> there;
    for (const auto& [name, known] : vehicles_) {
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
