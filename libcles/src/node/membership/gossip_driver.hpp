// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/membership/discovery.hpp"
#include "node/membership/gossip.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class local_node;

/// Sends the requests of `gossip` on the service's channels.
class gossip_driver final : public detail::gossip_service, private core::gossip::client {
  public:
    gossip_driver(local_node& host, std::uint32_t seed);
    gossip_driver(const gossip_driver&) = delete;
    gossip_driver& operator=(const gossip_driver&) = delete;
    ~gossip_driver() override;

    void set_seeds(const std::vector<std::string>& seeds) override;
    void start() override;
    void leave() override;
    void stop() override;
    void on_gone(std::string_view node, std::string_view where, time_point now) override;

  private:
    void ask(std::uint64_t ticket, std::string_view url, std::string_view since, std::string_view describe) override;
    void ask_description(std::uint64_t ticket, std::string_view url) override;
    void push(std::string_view url, std::string_view table) override;
    void release(std::string_view url) override;

    local_node& host_;
    core::gossip gossip_;
};

} // namespace cles::core
