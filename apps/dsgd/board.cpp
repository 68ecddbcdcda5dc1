// SPDX-License-Identifier: BSL-1.0
#include "board.hpp"

#include <algorithm>

namespace dsgd {

using cles::errc;

board::board(const std::vector<sgd::order>& orders, const std::vector<std::string>& targets)
    : parts_(orders.size()), nodes_(targets.begin(), targets.end()) {
    for (std::size_t i = 0; i < orders.size(); ++i) {
        shards_.push_back({.what = orders[i], .target = targets.empty() ? "any" : targets[i % targets.size()]});
    }
}

void board::done(std::size_t shard, const sgd::trained& part) {
    shards_[shard].fate = "done";
    parts_[shard] = part;
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
