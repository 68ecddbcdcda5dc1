// SPDX-License-Identifier: BSL-1.0
#include "video_session.hpp"

#include <cstddef>
#include <utility>

namespace jadc2 {
namespace {

constexpr double pause_s = 0.1; // before it is opened again

} // namespace

void video_session::opened(double now) {
    open_ = true;
    answered_ = false;
    opened_at_ = now;
}

bool video_session::is_silent(double now) const {
    if (!open_) {
        return false;
    }
    if (answered_) {
        return !sent_.empty() && now - sent_.front().at > silent_s_;
    }
    return now - opened_at_ > (sums_.done == 0 ? opening_s_ : silent_s_);
}

void video_session::captured(std::uint64_t frame, double now) {
    ++sums_.captured;
    if (open_) {
        sent_.push_back({.number = frame, .at = now});
    } else {
        miss(1);
    }
}

void video_session::miss(std::uint64_t count) noexcept {
    sums_.missing += count;
    before_next_ += count;
}

void video_session::give_up_frames() {
    miss(sent_.size());
    sent_.clear();
}

std::optional<video_session::news> video_session::result(std::string_view by, std::uint64_t frame) {
    // Results come in the order of their frames: those before this one will not have any.
    std::size_t before = 0;
    while (before < sent_.size() && sent_[before].number < frame) {
        ++before;
    }
    if (!open_ || before == sent_.size() || sent_[before].number != frame) {
        return std::nullopt;
    }
    miss(before);
    sent_.erase(sent_.begin(), sent_.begin() + static_cast<std::ptrdiff_t>(before) + 1);
    ++sums_.done;
    error_.clear();
    if (node_ != by) {
        node_ = by;
        constexpr std::size_t most = 1000; // enough for days of changes
        if (sums_.nodes.size() < most) {
            sums_.nodes.emplace_back(by);
        }
    }
    return news{.begins = !std::exchange(answered_, true), .missing = std::exchange(before_next_, 0)};
}

bool video_session::failed(const cles::error& why, double now) {
    give_up_frames();
    open_ = false;
    next_ = now + pause_s;
    const auto code = why.code();
    const bool ours = code.category() == cles::error_category();
    ++sums_.failures[ours ? std::string{cles::wire_name(static_cast<cles::errc>(code.value()))} : "unreachable"];
    return std::exchange(error_, why.what()) != why.what();
}

void video_session::ended() {
    give_up_frames();
    open_ = false;
}

} // namespace jadc2
