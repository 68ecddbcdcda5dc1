// SPDX-License-Identifier: BSL-1.0
#include "federation/taken_requests.hpp"

namespace cles::bridging {

bool seen_numbers::add(std::uint64_t number) noexcept {
    if (highest_ >= window && number <= highest_ - window) {
        return false;
    }
    if (number > highest_) {
        if (number - highest_ >= window) {
            seen_.reset();
        } else {
            for (auto skipped = highest_ + 1; skipped < number; ++skipped) {
                seen_.reset(skipped % window);
            }
            seen_.reset(number % window);
        }
        highest_ = number;
    }
    const auto at = number % window;
    return seen_.test(at) ? false : (seen_.set(at), true);
}

std::optional<std::uint64_t> taken_requests::add(request taken) {
    const bool is_numbered = !taken.by.pool.empty();
    if (is_numbered && !seen_[taken.by].add(taken.number)) {
        return {};
    }
    const auto id = ++last_id_;
    if (is_numbered) {
        ids_.emplace(std::pair{taken.by, taken.number}, id);
        unacknowledged_.push_back(id);
    }
    taken_.emplace(id, std::move(taken));
    return id;
}

const taken_requests::request* taken_requests::find(std::uint64_t id) const {
    const auto found = taken_.find(id);
    return found == taken_.end() ? nullptr : &found->second;
}

std::optional<std::uint64_t> taken_requests::id_of(const bridge_id& by, std::uint64_t number) const {
    const auto found = ids_.find({by, number});
    return found == ids_.end() ? std::nullopt : std::optional{found->second};
}

void taken_requests::remove(std::uint64_t id) {
    if (const auto found = taken_.find(id); found != taken_.end()) {
        ids_.erase({found->second.by, found->second.number});
        taken_.erase(found);
    }
}

std::vector<const taken_requests::request*> taken_requests::take_unacknowledged() {
    std::vector<const request*> open;
    for (const auto id : unacknowledged_) {
        if (const auto* r = find(id)) {
            open.push_back(r);
        }
    }
    unacknowledged_.clear();
    return open;
}

std::vector<std::uint64_t> taken_requests::requests_of(const bridge_id& by) const {
    std::vector<std::uint64_t> found;
    for (const auto& [id, r] : taken_) {
        if (r.by == by) {
            found.push_back(id);
        }
    }
    return found;
}

std::vector<std::uint64_t> taken_requests::requests_of(std::string_view pool, std::string_view member) const {
    std::vector<std::uint64_t> found;
    for (const auto& [id, r] : taken_) {
        if (r.by.pool == pool && r.member == member) {
            found.push_back(id);
        }
    }
    return found;
}

void taken_requests::clear() {
    taken_.clear();
    ids_.clear();
    seen_.clear();
    unacknowledged_.clear();
}

} // namespace cles::bridging
