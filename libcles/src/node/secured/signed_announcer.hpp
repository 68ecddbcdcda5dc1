// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/membership/announcement.hpp"
#include "port/group_port.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class local_node;
class node_security;
struct node_state;

/// Signs it as an update of `path`. What it omits is the same as in the line of an announcement that is not signed.
std::shared_ptr<const signed_announcement> sign_announcement(const announcement& said, std::string_view path,
                                                             std::uint64_t seq, std::string_view epoch,
                                                             const node_security& security);

/// See `security_protocol::endpoints`.
std::vector<std::string> endpoints_of_interfaces(local_node& host, const std::vector<group_port*>& in_group, bool all);

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

} // namespace cles::core
