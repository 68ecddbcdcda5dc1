// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::shell {
class local_node;
} // namespace cles::shell

namespace cles::detail {

/// A service's part in gossip, as the rest of the service sees it.
class gossip_host {
  public:
    gossip_host() = default;
    gossip_host(const gossip_host&) = delete;
    gossip_host& operator=(const gossip_host&) = delete;
    virtual ~gossip_host() = default;

    /// \throws cles::error where one of them is no URL
    virtual void set_seeds(const std::vector<std::string>& seeds) = 0;
    virtual void start() = 0;
    /// Says farewell, and goes on asking.
    virtual void leave() = 0;
    /// Leaves, and ends.
    virtual void stop() = 0;
    /// A node has gone without a word.
    virtual void on_gone(std::string_view node, std::string_view where, time_point now) = 0;
};

/// How it is made for a service, which answers what others ask by it from then on.
struct gossip_part {
    std::unique_ptr<gossip_host> (*make)(shell::local_node& host, std::uint32_t seed);
};

} // namespace cles::detail
