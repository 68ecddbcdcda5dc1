// SPDX-License-Identifier: BSL-1.0
#include "round_plan.hpp"

#include "dsgd/median.hpp"

#include <algorithm>
#include <utility>

namespace dsgd {

using cles::errc;

void round_plan::join(const std::string& node) {
    // One that is started again has lost what it was asked for.
    members_[node] = {};
}

std::vector<std::string> round_plan::to_ask(double now_ms) {
    std::vector<std::string> out;
    if (finished()) {
        return out;
    }
    for (auto& [node, its] : members_) {
        // A node that joins during a round would hold it up.
        if (its.is == state::idle && (!begun_ || its.attempts > 0)) {
            its.is = state::asked;
            out.push_back(node);
        }
    }
    if (!out.empty() && !begun_) {
        begun_ = true;
        began_ms_ = now_ms;
    }
    return out;
}

void round_plan::answered(const std::string& node, std::uint64_t round, digits::network result, std::uint64_t images,
                          double loss, double now_ms) {
    const auto its = members_.find(node);
    if (its == members_.end() || (its->second.is != state::asked && its->second.is != state::late)) {
        return;
    }
    if (result.form != now_.form || images == 0) {
        failed(node, round, {errc::conversion, "it answers with a network of another shape, or of no images"});
        return;
    }
    const bool in_time = round == round_ && its->second.is == state::asked;
    its->second = {.is = in_time ? state::answered : state::idle};
    if (in_time) {
        parts_.push_back(
            {.node = node, .result = std::move(result), .images = images, .loss = loss, .took_ms = now_ms - began_ms_});
    }
}

void round_plan::failed(const std::string& node, std::uint64_t round, const cles::error& why) {
    const auto its = members_.find(node);
    if (failure_ || its == members_.end() ||
        (its->second.is != state::asked && its->second.is != state::late)) { // of a former run of the node
        return;
    }
    const auto code = why.code();
    const bool lost = code == errc::unavailable || code == errc::deadline || code == errc::no_target ||
                      code == errc::no_task || code == errc::busy || code.category() != cles::error_category();
    if (code == errc::busy && its->second.attempts < most_attempts) {
        its->second.attempts += round == round_ ? 1U : 0U;
        its->second.is = state::idle;
        return;
    }
    members_.erase(its);
    if (!lost || members_.empty()) {
        failure_.emplace(code, node + ": " + why.what());
    }
}

bool round_plan::is_over(double now_ms) const {
    std::size_t asked = 0;
    for (const auto& each : members_) {
        asked += each.second.is == state::asked || each.second.attempts > 0 ? 1U : 0U;
    }
    if (asked == 0 || parts_.size() < asked) {
        return asked == 0; // at least half have answered otherwise
    }
    std::vector<double> took;
    for (const auto& each : parts_) {
        took.push_back(each.took_ms);
    }
    return now_ms - began_ms_ > late_factor * median(std::move(took)) + late_more_ms;
}

std::optional<round_result> round_plan::end_round(double now_ms) {
    if (!begun_ || finished() || !is_over(now_ms)) {
        return {};
    }
    round_result out{.round = round_, .began_ms = began_ms_, .ended_ms = now_ms};
    std::vector<digits::weighted_network> parts;
    std::sort(parts_.begin(), parts_.end(), [](const part& a, const part& b) { return a.node < b.node; });
    for (const auto& each : parts_) {
        const auto images = static_cast<double>(each.images);
        parts.push_back({.of = &each.result, .weight = images});
        out.nodes.push_back(each.node);
        out.images += each.images;
        out.loss += images * each.loss;
    }
    for (auto& [node, its] : members_) {
        if (its.is == state::asked) {
            its.is = state::late;
            out.late.push_back(node);
        } else if (its.is == state::answered) {
            its.is = state::idle;
        }
        its.attempts = 0;
    }
    begun_ = false;
    if (parts.empty()) { // all that were asked are lost, or started again: the same round begins anew
        return {};
    }
    out.loss /= static_cast<double>(out.images);
    now_ = average(parts);
    parts_.clear();
    ++round_;
    return out;
}

std::vector<std::string> round_plan::members() const {
    std::vector<std::string> out;
    for (const auto& each : members_) {
        out.push_back(each.first);
    }
    return out;
}

} // namespace dsgd
