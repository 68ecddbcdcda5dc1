// SPDX-License-Identifier: BSL-1.0
#include "shell/networks.hpp"

#include <cles/error.hpp>

#include <boost/asio/ip/address.hpp>

#include <algorithm>

namespace cles::shell {
namespace ip = boost::asio::ip;

networks::networks(const std::vector<std::string>& texts) {
    for (const auto& text : texts) {
        boost::system::error_code not_v4;
        boost::system::error_code not_v6;
        const bool alone = text.find('/') == std::string::npos;
        const auto v4 = ip::make_network_v4(alone ? text + "/32" : text, not_v4);
        const auto v6 = ip::make_network_v6(alone ? text + "/128" : text, not_v6);
        if (!not_v4) {
            v4_.push_back(v4);
        } else if (!not_v6) {
            v6_.push_back(v6);
        } else {
            throw error(errc::invalid_url, "'" + text + "' is not a network such as 10.0.0.0/8 or fd00::/8");
        }
    }
}

bool networks::contain(std::string_view text) const {
    boost::system::error_code code;
    auto address = ip::make_address(text, code);
    if (code) {
        return false;
    }
    // A network says by its first bits which addresses are its own: those that it leaves unchanged.
    if (address.is_v4()) {
        const auto bits = address.to_v4();
        return std::any_of(v4_.begin(), v4_.end(), [&](const auto& n) {
            return ip::make_network_v4(bits, n.prefix_length()).network() == n.network();
        });
    }
    auto bits = address.to_v6();
    bits.scope_id(0);
    return std::any_of(v6_.begin(), v6_.end(), [&](const auto& n) {
        return ip::make_network_v6(bits, n.prefix_length()).network() == n.network();
    });
}

} // namespace cles::shell
