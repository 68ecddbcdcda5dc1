// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/datagram_format.hpp"
#include "security/datagrams/entropy.hpp"
#include "security/datagrams/fork_count.hpp"
#include "security/fleet/fleet.hpp"

#include <array>
#include <cstdint>
#include <string_view>

namespace cles::security {

/// Seals what a node sends to the multicast group (docs/protocol_security.md, "In the multicast group"). No nonce is
/// used twice: the salt is random, new in each process and at the end of the counter.
class group_sender {
  public:
    group_sender(const fleet& of, entropy& random, std::uint64_t first_counter = 0);

    /// \return the datagram, valid until the next call; empty if the line is too long, or this node is not in the
    /// roster
    [[nodiscard]] bytes_view seal(std::string_view line);

    /// For what this node states of itself in a session: under which salt it sends, and from which counter on.
    [[nodiscard]] const group_salt& salt();
    [[nodiscard]] std::uint64_t next_counter();

  private:
    void refresh();
    void draw_salt();

    const fleet& fleet_;
    entropy& random_;
    fork_detector process_;
    group_salt salt_{};
    std::uint64_t counter_;
    std::array<std::uint8_t, max_sealed> sealed_{};
};

} // namespace cles::security
