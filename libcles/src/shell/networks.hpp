// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/ip/network_v4.hpp>
#include <boost/asio/ip/network_v6.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace cles::shell {

/// Networks as they are configured: "10.0.0.0/8", "fd00::/8", or an address alone.
class networks {
  public:
    networks() = default;
    /// \throws cles::error with `invalid_url` where one is no network
    explicit networks(const std::vector<std::string>& texts);

    /// Whether a numeric address is of one of them.
    [[nodiscard]] bool contain(std::string_view text) const;

  private:
    std::vector<boost::asio::ip::network_v4> v4_;
    std::vector<boost::asio::ip::network_v6> v6_;
};

} // namespace cles::shell
