// SPDX-License-Identifier: BSL-1.0
#include "impaired_line.hpp"

#include <algorithm>
#include <utility>

namespace cles::perf {
namespace {

constexpr double bits_per_byte = 8;
constexpr double max_jitter = 20; // times the average

} // namespace

void impaired_line::send(clock::time_point now, frame sent) {
    if (under_way_.size() >= how_.queue) {
        ++overflown_;
        return;
    }
    // The line is occupied for the transmission time of the frame, even if the frame is lost.
    auto sent_by = std::max(now, free_);
    if (how_.bits_per_s != 0) {
        const double seconds = static_cast<double>(sent.size()) * bits_per_byte / static_cast<double>(how_.bits_per_s);
        sent_by += std::chrono::duration_cast<clock::duration>(std::chrono::duration<double>(seconds));
        free_ = sent_by;
    }
    const auto jitter = draw_jitter();
    if (std::uniform_real_distribution<>{}(chance_) < how_.loss) {
        ++lost_;
        return;
    }
    last_arrival_ = std::max(last_arrival_, sent_by + how_.delay + jitter);
    under_way_.push_back({last_arrival_, std::move(sent)});
}

std::optional<impaired_line::clock::time_point> impaired_line::next_arrival() const {
    return under_way_.empty() ? std::nullopt : std::optional{under_way_.front().arrives};
}

std::optional<impaired_line::frame> impaired_line::receive(clock::time_point now) {
    if (under_way_.empty() || under_way_.front().arrives > now) {
        return std::nullopt;
    }
    auto arrived = std::move(under_way_.front().content);
    under_way_.pop_front();
    ++carried_;
    return arrived;
}

impaired_line::clock::duration impaired_line::draw_jitter() {
    if (how_.jitter <= clock::duration::zero()) {
        return {};
    }
    const double times = std::min(std::exponential_distribution<>{}(chance_), max_jitter);
    return std::chrono::duration_cast<clock::duration>(std::chrono::duration<double, std::nano>(
        static_cast<double>(std::chrono::nanoseconds{how_.jitter}.count()) * times));
}

} // namespace cles::perf
