// SPDX-License-Identifier: BSL-1.0
#include "transport/name_lookups.hpp"

#include <algorithm>
#include <utility>

namespace cles::transport {

name_lookups::answer name_lookups::ask(std::string_view name, ticket who, time_point now) {
    auto found = names_.find(name);
    if (found == names_.end()) {
        if (!make_space(now)) {
            return {.what = step::refused};
        }
        found = names_.emplace(std::string{name}, entry{.is = state::known, .until = now}).first;
    }
    auto& e = found->second;
    if (e.is == state::known && now < e.until) {
        return {.what = step::known, .now_known = e.last};
    }
    e.waiting.push_back(who);
    if (e.is != state::known) {
        return {.what = step::waits};
    }
    if (running_ < bounds_.at_once) {
        ++running_;
        e.is = state::running;
        return {.what = step::start};
    }
    e.is = state::queued;
    queue_.emplace_back(name);
    return {.what = step::waits};
}

// Only names of which nothing is known any more, and nobody waits for.
bool name_lookups::make_space(time_point now) {
    if (names_.size() >= bounds_.names) {
        std::erase_if(names_,
                      [now](const auto& each) { return each.second.is == state::known && each.second.until <= now; });
    }
    return names_.size() < bounds_.names;
}

void name_lookups::forget(std::string_view name, ticket who) {
    const auto found = names_.find(name);
    if (found == names_.end()) {
        return;
    }
    auto& e = found->second;
    std::erase(e.waiting, who);
    if (e.is == state::queued && e.waiting.empty()) {
        std::erase(queue_, found->first);
        names_.erase(found);
    }
}

std::vector<name_lookups::ticket> name_lookups::finish(std::string_view name, outcome found, time_point now) {
    const auto known = names_.find(name);
    if (known == names_.end()) {
        return {};
    }
    auto& e = known->second;
    --running_;
    e.is = state::known;
    e.until = now + (found.code ? bounds_.keep_failed : bounds_.keep_found);
    e.last = std::move(found);
    return std::exchange(e.waiting, {});
}

std::vector<name_lookups::ticket> name_lookups::abort(std::string_view name) {
    const auto known = names_.find(name);
    if (known == names_.end()) {
        return {};
    }
    --running_;
    auto waiting = std::move(known->second.waiting);
    names_.erase(known);
    return waiting;
}

std::optional<std::string> name_lookups::next() {
    if (queue_.empty() || running_ >= bounds_.at_once) {
        return std::nullopt;
    }
    auto name = std::move(queue_.front());
    queue_.pop_front();
    names_.find(name)->second.is = state::running;
    ++running_;
    return name;
}

std::vector<std::string> name_lookups::running() const {
    std::vector<std::string> all;
    for (const auto& [name, e] : names_) {
        if (e.is == state::running) {
            all.push_back(name);
        }
    }
    return all;
}

void name_lookups::prefer(std::string_view place, const boost::asio::ip::address& answered) {
    constexpr std::size_t most = 128;
    std::erase_if(preferred_, [place](const auto& each) { return each.first == place; });
    preferred_.emplace_front(place, answered);
    if (preferred_.size() > most) {
        preferred_.pop_back();
    }
}

std::optional<boost::asio::ip::address> name_lookups::preferred(std::string_view place) const {
    const auto found =
        std::find_if(preferred_.begin(), preferred_.end(), [place](const auto& each) { return each.first == place; });
    return found == preferred_.end() ? std::nullopt : std::optional{found->second};
}

} // namespace cles::transport
