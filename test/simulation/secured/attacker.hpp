// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/roster.hpp"
#include "simulation/network/dice.hpp"
#include "simulation/network/network.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::simulation {

class stranger;

/// Somebody in the network who sees all datagrams, sends any from any address, and opens streams. It has the roster,
/// and no key of a member.
class attacker {
  public:
    enum class deed : std::uint8_t { noise, flipped, headed, repeated, redirected, unsealed, keyless, stream };

    attacker(network& net, std::uint64_t seed);
    attacker(const attacker&) = delete;
    attacker& operator=(const attacker&) = delete;
    ~attacker();

    void attack(deed what, unsigned host, unsigned count, const security::roster& stolen);
    /// Repeats everything that it remembers.
    void repeat_all();
    /// Closes its streams.
    void leave();

  private:
    struct recorded {
        endpoint from;
        std::optional<endpoint> to;
        std::string bytes;
    };

    void record(const endpoint& from, std::optional<endpoint> to, std::string_view bytes);
    [[nodiscard]] const recorded& any() { return memory_[chance_.below(static_cast<unsigned>(memory_.size()))]; }
    [[nodiscard]] std::string random_bytes(std::size_t size);
    [[nodiscard]] std::string line_for(const security::roster& stolen, std::string_view victim);
    void send_headed(unsigned host, const security::member& as);
    void send_keyless(unsigned host, const security::roster& stolen, const security::member& as);

    network& net_;
    dice chance_;
    std::vector<recorded> memory_; // some of all datagrams, old ones too
    std::size_t seen_ = 0;
    std::uint32_t last_op_ = 0xF000'0000;
    std::vector<std::shared_ptr<stranger>> strangers_;
};

} // namespace cles::simulation
