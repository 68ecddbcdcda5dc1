// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/gossip.hpp"
#include "shell/gossip_part.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::shell {

class local_node;

/// Carries out what gossip decides: asks other nodes for their tables by the routes of the service.
class gossiper final : public detail::gossip_host, private core::gossip::caller {
  public:
    gossiper(local_node& host, std::uint32_t seed);
    gossiper(const gossiper&) = delete;
    gossiper& operator=(const gossiper&) = delete;
    ~gossiper() override;

    void set_seeds(const std::vector<std::string>& seeds) override;
    void start() override;
    void leave() override;
    void stop() override;
    void on_gone(std::string_view node, std::string_view where, time_point now) override;

  private:
    void ask(std::uint64_t ticket, std::string_view url, std::string_view since, std::string_view describe) override;
    void ask_who(std::uint64_t ticket, std::string_view url) override;
    void tell(std::string_view url, std::string_view table) override;
    void release(std::string_view url) override;

    local_node& host_;
    core::gossip gossip_;
};

} // namespace cles::shell
