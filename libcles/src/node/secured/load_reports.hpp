// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/membership/announcement.hpp"
#include "port/group_port.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <optional>
#include <string>

/// The load that a node reports in the group between signed announcements (docs/security.md, "Announcements").

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

/// Takes the report of another node. Returns false if it is malformed.
[[nodiscard]] bool take_load_report(node_state& host, const group_source& from, const protocol::request_line& report,
                                    time_point now);

} // namespace cles::core
