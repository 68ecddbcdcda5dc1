// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/membership/announcement.hpp"

#include <cstdint>
#include <optional>
#include <string>

namespace cles::core {

struct node_state;

/// Signs the announcements of this node, and decides when its load is enough.
class signed_announcer {
  public:
    /// The node outlives this.
    explicit signed_announcer(node_state& host) noexcept : host_(host) {}

    /// The next announcement is signed, even if nothing has changed.
    void sign_next() noexcept { must_sign_ = true; }
    /// See `security_protocol::announce`.
    [[nodiscard]] std::string announce(announcement& said, std::uint64_t& seq, bool in_group, bool by_gossip);

  private:
    [[nodiscard]] bool is_load_enough(const announcement& said) const;

    node_state& host_;
    std::optional<announcement> last_; // that was signed
    bool must_sign_ = true;
};

/// Whether two announcements of a node have the same content, except for the load of the same workers.
[[nodiscard]] bool differ_in_load_only(const announcement& one, const announcement& other);

} // namespace cles::core
