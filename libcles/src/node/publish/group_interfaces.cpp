// SPDX-License-Identifier: BSL-1.0
#include "node/publish/group_interfaces.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

/// Whether datagrams of both are sent and received by the same interface, from the same address.
bool is_same(const network_interface& a, const network_interface& b) noexcept {
    return a.index == b.index && a.address == b.address && a.name == b.name;
}

bool has_same(const std::vector<network_interface>& all, const network_interface& one) noexcept {
    return std::ranges::any_of(all, [&](const auto& each) { return is_same(each, one); });
}

} // namespace

group_interfaces::group_interfaces(const multicast_options& where) : automatic_(where.interface == "auto") {
    if (!automatic_) {
        names_ = interfaces_of(where);
    }
}

void group_interfaces::on_change(time_point now) noexcept {
    if (!changed_at_) {
        changed_at_ = now;
    }
    settled_at_ = std::min(now + settling, *changed_at_ + longest_settling);
}

std::optional<time_point> group_interfaces::due() const noexcept {
    return settled_at_ && retry_at_ ? std::min(settled_at_, retry_at_) : settled_at_ ? settled_at_ : retry_at_;
}

std::vector<network_interface> group_interfaces::wanted_of(const std::vector<network_interface>& all) const {
    if (automatic_) {
        return automatic(all);
    }
    std::vector<network_interface> wanted;
    for (const auto& name : names_) {
        const auto found = std::ranges::find(all, name, &network_interface::name);
        if (found != all.end() && found->up && found->address != 0) {
            wanted.push_back(*found);
        }
    }
    return wanted;
}

group_interfaces::steps group_interfaces::compare(const std::vector<network_interface>& all) {
    if (std::exchange(settled_at_, std::nullopt)) { // what has failed before may work now
        pause_ = doubling_pause{first_retry};
    }
    changed_at_.reset();
    retry_at_.reset();
    steps result;
    for (const auto& each : joined_) {
        if (!has_same(all, each)) {
            result.leave.push_back(each);
        }
    }
    std::erase_if(joined_, [&](const auto& each) { return !has_same(all, each); });
    const auto wanted = wanted_of(all);
    std::erase_if(failed_, [&](const auto& each) { return !has_same(wanted, each); });
    for (const auto& each : wanted) {
        if (has_same(joined_, each)) {
            continue;
        }
        if (joined_.size() + result.join.size() < multicast_options::most_interfaces) {
            result.join.push_back(each);
        } else {
            result.left_out.push_back(each.name);
        }
    }
    return result;
}

void group_interfaces::on_joined(const network_interface& where) {
    std::erase_if(failed_, [&](const auto& each) { return is_same(each, where); });
    joined_.push_back(where);
}

bool group_interfaces::on_failed(const network_interface& where, bool again, time_point now) {
    if (again) {
        retry(now);
    }
    const bool is_new = !has_same(failed_, where);
    if (is_new) {
        failed_.push_back(where);
    }
    return is_new;
}

void group_interfaces::retry(time_point now) {
    if (!retry_at_) {
        retry_at_ = now + pause_.take(longest_retry);
    }
}

} // namespace cles::core
