// SPDX-License-Identifier: BSL-1.0
#include "board.hpp"

#include "dsgd/median.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace dsgd {

using cles::errc;

namespace {

constexpr const char* any = "any";

} // namespace

std::uint64_t least_points(const sgd::order& like) {
    const auto epochs = static_cast<double>(like.epochs.value_or(1));
    const auto steps = 5 / like.rate.value_or(sgd::schedule{}.rate);
    constexpr double at_least = 500, more_than_any_data = 1e9;
    return static_cast<std::uint64_t>(std::clamp(std::ceil(steps / epochs), at_least, more_than_any_data));
}

board::board(const std::vector<sgd::order>& orders, const std::vector<std::string>& targets)
    : slots_(orders.size()), parts_(orders.size()), nodes_(targets.begin(), targets.end()) {
    for (std::size_t i = 0; i < orders.size(); ++i) {
        points_ += orders[i].count;
        slot_targets_.push_back(targets.empty() ? std::string{any} : targets[i % targets.size()]);
        shards_.push_back({.what = orders[i], .target = slot_targets_[i], .slot = i});
    }
}

board::board(std::uint64_t points, std::size_t slots, const sgd::order& like, const std::vector<std::string>& targets)
    : slots_(slots), points_(points), slots_per_node_(std::max<std::size_t>(1, slots / targets.size())), like_(like),
      splitter_(std::in_place, points, slots, least_points(like)), nodes_(targets.begin(), targets.end()) {
    for (std::size_t i = 0; i < slots; ++i) {
        slot_targets_.push_back(targets[i % targets.size()]);
    }
}

void board::join(const std::string& node, std::size_t workers) {
    nodes_.insert(node);
    workers_.erase(node);
    if (workers > 0) {
        workers_.emplace(node, workers);
    }
    if (!splitter_ || std::find(slot_targets_.begin(), slot_targets_.end(), node) != slot_targets_.end()) {
        return;
    }
    for (std::size_t i = 0; i < slots_per_node_; ++i) {
        slot_targets_.push_back(node);
        splitter_->add_slot();
        ++slots_;
    }
}

std::optional<std::size_t> board::next(double now_ms) {
    if (failure_) {
        return {};
    }
    if (splitter_) {
        return nodes_.empty() ? std::nullopt : next_of_slots(now_ms);
    }
    for (std::size_t i = 0; i < shards_.size(); ++i) {
        if (!begun_.contains(i) && may_take(shards_[i].target)) {
            return begin(i, shards_[i].target, now_ms);
        }
    }
    return {};
}

std::optional<std::size_t> board::next_of_slots(double now_ms) {
    for (std::size_t slot = 0; slot < slots_; ++slot) {
        if (busy_.contains(slot)) {
            continue;
        }
        const auto shard = splitter_->next(slot, now_ms);
        if (shard.count == 0) {
            continue;
        }
        auto what = like_;
        what.first = shard.first;
        what.count = shard.count;
        what.seed = like_.seed.value_or(1) + shards_.size();
        what.start = last_result(slot);
        shards_.push_back({.what = what, .target = target_of(slot), .slot = slot});
        parts_.emplace_back();
        busy_.insert(slot);
        return begin(shards_.size() - 1, shards_.back().target, now_ms);
    }
    return {};
}

std::optional<std::size_t> board::late(double now_ms) {
    if (failure_ || took_ms_.empty()) {
        return {};
    }
    const auto usual_ms = median(took_ms_);
    std::map<std::size_t, double> begun_ms; // when a shard was last given to a node
    for (const auto& each : attempts_) {
        if (!each.ended) {
            auto& last = begun_ms.try_emplace(each.shard, each.begun_ms).first->second;
            last = std::max(last, each.begun_ms);
        }
    }
    for (const auto& [shard, since_ms] : begun_ms) {
        auto& entry = shards_[shard];
        const bool is_late = now_ms - since_ms > late_factor_ * expected_ms(entry, usual_ms) + late_more_ms;
        if (!is_late || entry.also.size() >= most_copies) {
            continue;
        }
        if (const auto helper = helper_for(shard)) {
            entry.also.push_back(*helper);
            return begin(shard, *helper, now_ms);
        }
    }
    return {};
}

bool board::finished() const {
    return std::none_of(shards_.begin(), shards_.end(), [](const entry& e) { return e.fate == "open"; });
}

std::size_t board::begin(std::size_t shard, const std::string& target, double now_ms) {
    begun_.insert(shard);
    ++running_[target];
    attempts_.push_back({.shard = shard, .target = target, .begun_ms = now_ms});
    return attempts_.size() - 1;
}

void board::end(attempt& which) {
    which.ended = true;
    --running_[which.target];
}

void board::move(attempt& which, const std::string& target) {
    --running_[which.target];
    which.target = target;
    ++running_[target];
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
    const auto& wanted = slot_targets_[slot];
    return nodes_.contains(wanted) ? wanted : least_loaded();
}

std::size_t board::running_at(const std::string& target) const {
    const auto found = running_.find(target);
    return found == running_.end() ? 0 : found->second;
}

std::size_t board::attempts_for(std::size_t shard) const {
    return static_cast<std::size_t>(std::count_if(
        attempts_.begin(), attempts_.end(), [&](const attempt& each) { return each.shard == shard && !each.ended; }));
}

bool board::may_take(const std::string& target) const {
    if (target != any) {
        const auto workers = workers_.find(target);
        return !nodes_.empty() && (workers == workers_.end() || running_at(target) < workers->second);
    }
    std::size_t workers = 0;
    std::size_t running = 0;
    for (const auto& node : nodes_) {
        const auto known = workers_.find(node);
        if (known == workers_.end()) {
            return true;
        }
        workers += known->second;
    }
    for (const auto& each : running_) {
        running += each.second;
    }
    return nodes_.empty() || running < workers;
}

double board::expected_ms(const entry& shard, double usual_ms) const {
    if (!splitter_) {
        return usual_ms; // all have as much to do, by the speed of their nodes
    }
    const auto speed = splitter_->speed(shard.slot);
    const auto points = static_cast<double>(shard.what.count);
    return speed > 0 ? points / speed : points * usual_ms;
}

// A node that has answered since the shard was begun is alive; among such nodes, one that helps the least.
std::optional<std::string> board::helper_for(std::size_t shard) const {
    if (shards_[shard].target == any && !may_take(any)) {
        return {};
    }
    std::set<std::string> asked;
    double since_ms = 0;
    for (const auto& each : attempts_) {
        if (each.shard == shard && !each.ended) {
            since_ms = asked.empty() ? each.begun_ms : since_ms;
            asked.insert(each.target);
        }
    }
    std::optional<std::tuple<bool, std::size_t, double, std::string>> best;
    for (const auto& node : nodes_) {
        if (asked.contains(node) || !may_take(node)) {
            continue;
        }
        const auto heard = heard_ms_.find(node);
        const auto heard_ms = heard == heard_ms_.end() ? -1 : heard->second;
        std::tuple candidate{heard_ms < since_ms, running_at(node), -heard_ms, node};
        if (!best || candidate < *best) {
            best = std::move(candidate);
        }
    }
    return best ? std::optional{std::get<std::string>(*best)} : std::nullopt;
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

std::vector<std::size_t> board::done(std::size_t attempt, const sgd::trained& part) {
    auto& answered = attempts_[attempt];
    if (answered.ended) {
        return {};
    }
    end(answered);
    const auto now_ms = part.after_ms.value_or(part.ms);
    auto& shard = shards_[answered.shard];
    shard.fate = "done";
    shard.target = answered.target;
    parts_[answered.shard] = part;
    const auto points = static_cast<double>(std::max<std::uint64_t>(1, shard.what.count));
    took_ms_.push_back((now_ms - answered.begun_ms) / (splitter_ ? points : 1));
    if (const auto& node = answered.target == any ? part.node : answered.target; !node.empty()) {
        heard_ms_[node] = now_ms;
        nodes_.insert(node);
    }
    if (splitter_) {
        splitter_->done(shard.slot, now_ms);
        busy_.erase(shard.slot);
    }
    std::vector<std::size_t> others;
    for (std::size_t i = 0; i < attempts_.size(); ++i) {
        if (attempts_[i].shard == answered.shard && !attempts_[i].ended) {
            end(attempts_[i]);
            others.push_back(i);
            if (attempts_[i].begun_ms < answered.begun_ms) {
                avoid(attempts_[i].target);
            }
        }
    }
    return others;
}

bool board::failed(std::size_t attempt, const cles::error& why, double now_ms) {
    auto& tried = attempts_[attempt];
    if (tried.ended) {
        return false;
    }
    auto& shard = shards_[tried.shard];
    if (failure_) {
        end(tried);
        shard.fate = shard.fate == "open" ? "withdrawn" : shard.fate;
        return false;
    }
    shard.trouble.push_back(tried.target + ": " + why.what());
    const auto code = why.code();
    bool again = code == errc::busy;
    const bool lost = code == errc::unavailable || code == errc::deadline || code == errc::no_target ||
                      code.category() != cles::error_category(); // a system error: no link was established
    if (lost && tried.target == any) {
        again = code != errc::no_target; // which means that there is no other node
    } else if (lost) {
        nodes_.erase(tried.target);
        again = !nodes_.empty();
        give_away(tried.target);
    }
    if (attempts_for(tried.shard) > 1) {
        end(tried);
        return false;
    }
    if (!again || shard.trouble.size() >= max_attempts) {
        end(tried);
        fail(tried.shard, why);
        return false;
    }
    if (lost && splitter_) {
        end(tried);
        shard.fate = "lost";
        splitter_->lost(shard.slot);
        busy_.erase(shard.slot);
        return false;
    }
    if (lost && tried.target != any) {
        move(tried, least_loaded());
    }
    shard.target = tried.target;
    tried.begun_ms = now_ms;
    return true;
}

void board::fail(std::size_t shard, const cles::error& why) {
    shards_[shard].fate = "failed";
    failure_.emplace(why.code(), "shard " + std::to_string(shard + 1) + ": " + shards_[shard].trouble.back());
    for (std::size_t i = 0; i < shards_.size(); ++i) {
        if (!begun_.contains(i)) {
            shards_[i].fate = "withdrawn";
        }
    }
}

void board::avoid(const std::string& node) {
    if (nodes_.size() > 1 && nodes_.erase(node) > 0) {
        give_away(node);
    }
}

void board::give_away(const std::string& node) {
    for (std::size_t i = 0; i < shards_.size() && !nodes_.empty(); ++i) {
        if (!begun_.contains(i) && shards_[i].target == node) {
            shards_[i].target = least_loaded();
        }
    }
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
