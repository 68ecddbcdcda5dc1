// SPDX-License-Identifier: BSL-1.0
#include "transport/address_race.hpp"

#include <algorithm>

namespace cles::transport {

using boost::asio::ip::address;

std::vector<address> in_connection_order(const std::vector<address>& found, const std::optional<address>& preferred) {
    std::vector<address> order;
    const auto add = [&order](const address& one) {
        if (order.size() < most_addresses && std::find(order.begin(), order.end(), one) == order.end()) {
            order.push_back(one);
        }
    };
    if (preferred && std::find(found.begin(), found.end(), *preferred) != found.end()) {
        add(*preferred);
    }
    std::vector<address> same; // the family of the first
    std::vector<address> other;
    for (const auto& one : found) {
        (one.is_v6() == found.front().is_v6() ? same : other).push_back(one);
    }
    for (std::size_t i = 0; i < std::max(same.size(), other.size()); ++i) {
        if (i < same.size()) {
            add(same[i]);
        }
        if (i < other.size()) {
            add(other[i]);
        }
    }
    return order;
}

std::optional<std::size_t> address_race::next(time_point now) noexcept {
    if (tried_ == count_ || (tried_ != 0 && now < due_)) {
        return std::nullopt;
    }
    due_ = now + patience;
    return tried_++;
}

std::optional<time_point> address_race::due() const noexcept {
    return tried_ == count_ ? std::nullopt : std::optional{due_};
}

void address_race::fail(time_point now) noexcept {
    ++failed_;
    due_ = now;
}

void address_race::accept(time_point now) noexcept { due_ = now + patience_once_accepted; }

bool probe_times::next(time_point now) noexcept {
    if (now < due_) {
        return false;
    }
    pause_ = std::min(pause_ * 2, longest_pause);
    due_ = now + pause_;
    return true;
}

} // namespace cles::transport
