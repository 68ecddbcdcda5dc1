// SPDX-License-Identifier: BSL-1.0
#include "gateway/access/client_limits.hpp"

#include <boost/asio/ip/address.hpp>

#include <algorithm>

namespace gateway {

const client_limits::holder* client_limits::largest() const {
    const holder* found = nullptr;
    for (const auto& [address, each] : holders_) {
        if (!each.idle.empty() && (found == nullptr || each.count > found->count)) {
            found = &each;
        }
    }
    return found;
}

client_limits::verdict client_limits::admit(const std::string& address) {
    verdict made;
    const auto known = holders_.find(address);
    const bool is_too_much = of_address_ != 0 && known != holders_.end() && known->second.count >= of_address_;
    if (is_too_much || clients_.size() >= most_) {
        const auto* const gives_way = is_too_much ? &known->second : largest();
        if (gives_way == nullptr || gives_way->idle.empty()) {
            return made;
        }
        made.evicted = *gives_way->idle.begin();
        leave(*made.evicted);
    }
    made.number = ++last_;
    clients_.emplace(made.number, address);
    auto& of_address = holders_[address];
    ++of_address.count;
    of_address.idle.insert(made.number);
    return made;
}

void client_limits::leave(std::uint64_t number) {
    const auto found = clients_.find(number);
    if (found == clients_.end()) {
        return;
    }
    const auto known = holders_.find(found->second);
    known->second.idle.erase(number);
    if (--known->second.count == 0) {
        holders_.erase(known);
    }
    clients_.erase(found);
}

void client_limits::set_busy(std::uint64_t number, bool is_busy) {
    const auto found = clients_.find(number);
    if (found == clients_.end()) {
        return;
    }
    auto& idle = holders_[found->second].idle;
    if (is_busy) {
        idle.erase(number);
    } else {
        idle.insert(number);
    }
}

std::string client_address(const std::string& address) {
    boost::system::error_code code;
    const auto parsed = boost::asio::ip::make_address(address, code);
    if (code || !parsed.is_v6()) {
        return address;
    }
    const auto whole = parsed.to_v6();
    if (whole.is_v4_mapped()) {
        return boost::asio::ip::make_address_v4(boost::asio::ip::v4_mapped, whole).to_string();
    }
    auto bytes = whole.to_bytes();
    constexpr std::size_t network = 8;
    std::fill(bytes.begin() + network, bytes.end(), std::uint8_t{0});
    return boost::asio::ip::address_v6{bytes}.to_string();
}

} // namespace gateway
