// SPDX-License-Identifier: BSL-1.0
#include "node/session/dedup.hpp"

#include <utility>

namespace cles::core {

dedup::~dedup() {
    for (const auto& [id, e] : entries_) {
        shared_.used -= e.cost;
    }
}

const dedup::entry* dedup::find(std::uint64_t id, std::string_view bytes) const {
    const auto [first, last] = entries_.equal_range(id);
    for (auto at = first; at != last; ++at) {
        if (at->second.bytes() == bytes) {
            return &at->second;
        }
    }
    return nullptr;
}

dedup::verdict dedup::look(std::uint64_t id, std::string_view bytes) const {
    if (const auto* known = find(id, bytes)) {
        return known->running ? verdict::running : verdict::answered;
    }
    const auto [first, last] = entries_.equal_range(id);
    for (auto at = first; at != last; ++at) {
        if (at->second.running) {
            return verdict::clash;
        }
    }
    return verdict::fresh;
}

std::string_view dedup::reply(std::uint64_t id, std::string_view bytes) const {
    const auto* known = find(id, bytes);
    return known == nullptr ? std::string_view{} : std::string_view{known->text}.substr(known->request);
}

bool dedup::begin(std::uint64_t id, std::string_view bytes, std::size_t max_reply) {
    const auto cost = cost_of_entry + bytes.size() + max_reply;
    if (shared_.used + cost > shared_.limit) {
        return false;
    }
    enter(id, bytes, true, cost);
    return true;
}

void dedup::add_repeatable(std::uint64_t id, std::string_view bytes) {
    enter(id, bytes, false, cost_of_entry + bytes.size());
}

void dedup::enter(std::uint64_t id, std::string_view bytes, bool once, std::size_t cost) {
    const auto at = entries_.emplace(
        id, entry{.text = std::string{bytes}, .request = bytes.size(), .cost = 0, .running = true, .once = once});
    charge(at->second, cost);
}

void dedup::charge(entry& e, std::size_t cost) noexcept {
    shared_.used = shared_.used - e.cost + cost;
    e.cost = cost;
}

void dedup::forget(entries::iterator which) noexcept {
    charge(which->second, 0);
    entries_.erase(which);
}

void dedup::set_reply(std::uint64_t id, std::string_view reply, time_point now) {
    const auto [first, last] = entries_.equal_range(id);
    for (auto at = first; at != last; ++at) {
        auto& e = at->second;
        if (!e.running) {
            continue;
        }
        if (!e.once) {
            forget(at);
            return;
        }
        e.running = false;
        e.text.append(reply);
        charge(e, cost_of_entry + e.text.size());
        done_.push_back({at, now + memory});
        if (!armed()) {
            deadlines_.arm(*this, done_.front().until);
        }
        return;
    }
}

void dedup::on_deadline(time_point now) {
    while (!done_.empty() && done_.front().until <= now) {
        forget(done_.front().which);
        done_.pop_front();
    }
    if (!done_.empty()) {
        deadlines_.arm(*this, done_.front().until);
    }
}

} // namespace cles::core
