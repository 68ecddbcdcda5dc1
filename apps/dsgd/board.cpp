// SPDX-License-Identifier: BSL-1.0
#include "board.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace dsgd {

using cles::errc;

std::uint64_t least_points(const sgd::order& like) {
    const auto epochs = static_cast<double>(like.epochs.value_or(1));
    const auto steps = 5 / like.rate.value_or(sgd::schedule{}.rate);
    constexpr double at_least = 500, more_than_any_data = 1e9;
    return static_cast<std::uint64_t>(std::clamp(std::ceil(steps / epochs), at_least, more_than_any_data));
}

board::board(const std::vector<sgd::order>& orders, const std::vector<std::string>& targets)
    : slots_(orders.size()), targets_(targets), parts_(orders.size()), nodes_(targets.begin(), targets.end()) {
    for (std::size_t i = 0; i < orders.size(); ++i) {
        points_ += orders[i].count;
        shards_.push_back({.what = orders[i], .target = target_of(i), .slot = i});
    }
}

board::board(std::uint64_t points, std::size_t slots, const sgd::order& like, const std::vector<std::string>& targets)
    : slots_(slots), points_(points), targets_(targets), like_(like),
      splitter_(std::in_place, points, slots, least_points(like)), nodes_(targets.begin(), targets.end()) {}

std::optional<std::size_t> board::next(std::size_t slot, double now_ms) {
    if (!splitter_) {
        return begun_.insert(slot).second ? std::optional{slot} : std::nullopt;
    }
    const auto shard = failure_ ? sgd::shard{} : splitter_->next(slot, now_ms);
    if (shard.count == 0) {
        return {};
    }
    auto what = like_;
    what.first = shard.first;
    what.count = shard.count;
    what.seed = like_.seed.value_or(1) + shards_.size();
    what.start = last_result(slot);
    shards_.push_back({.what = what, .target = target_of(slot), .slot = slot});
    parts_.emplace_back();
    return shards_.size() - 1;
}

bool board::finished() const {
    return std::none_of(shards_.begin(), shards_.end(), [](const entry& e) { return e.fate == "open"; });
}

std::optional<sgd::classifier> board::last_result(std::size_t slot) const {
    for (auto i = parts_.size(); i-- > 0;) {
        if (shards_[i].slot == slot && shards_[i].fate == "done") {
            return parts_[i].result;
        }
    }
    return like_.start;
}

std::string board::target_of(std::size_t slot) const {
    if (targets_.empty()) {
        return "any";
    }
    const auto& wanted = targets_[slot % targets_.size()];
    return nodes_.contains(wanted) ? wanted : least_loaded();
}

times board::spent(double trial_ms) const {
    times out;
    std::vector<double> own(slots_);
    for (std::size_t i = 0; i < parts_.size(); ++i) {
        own[shards_[i].slot] += parts_[i].ms;
        out.elapsed_ms = std::max(out.elapsed_ms, parts_[i].after_ms.value_or(parts_[i].ms));
    }
    out.elapsed_ms += trial_ms;
    out.longest_ms = *std::max_element(own.begin(), own.end());
    out.overhead_ms = out.elapsed_ms - out.longest_ms;
    return out;
}

void board::done(std::size_t shard, const sgd::trained& part) {
    shards_[shard].fate = "done";
    parts_[shard] = part;
    if (splitter_) {
        splitter_->done(shards_[shard].slot, part.after_ms.value_or(part.ms));
    }
}

bool board::failed(std::size_t shard, const cles::error& why) {
    auto& shard_entry = shards_[shard];
    if (failure_) {
        shard_entry.fate = "withdrawn";
        return false;
    }
    shard_entry.trouble.push_back(shard_entry.target + ": " + why.what());
    const auto code = why.code();
    bool again = code == errc::busy;
    const bool lost = code == errc::unavailable || code == errc::deadline || code == errc::no_target ||
                      code.category() != cles::error_category(); // a system error: no link was established
    if (lost && shard_entry.target == "any") {
        again = code != errc::no_target; // which means that there is no other node
    } else if (lost) {
        nodes_.erase(shard_entry.target);
        again = !nodes_.empty();
        if (again && splitter_) {
            shard_entry.fate = "lost";
            splitter_->lost(shard_entry.slot);
            return true;
        }
        shard_entry.target = again ? least_loaded() : shard_entry.target;
    }
    if (!again || shard_entry.trouble.size() == max_attempts) {
        shard_entry.fate = "failed";
        failure_.emplace(code, "shard " + std::to_string(shard + 1) + ": " + shard_entry.trouble.back());
    }
    return !failure_;
}

std::string board::least_loaded() const {
    const auto has = [this](const std::string& node) {
        return std::count_if(shards_.begin(), shards_.end(),
                             [&](const entry& e) { return e.fate == "open" && e.target == node; });
    };
    return *std::min_element(nodes_.begin(), nodes_.end(),
                             [&](const auto& a, const auto& b) { return has(a) < has(b); });
}

} // namespace dsgd
