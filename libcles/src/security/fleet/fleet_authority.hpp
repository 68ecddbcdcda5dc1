// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/group_keys.hpp"
#include "security/fleet/roster.hpp"
#include "security/keys/identity.hpp"

#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace cles::security {

/// Makes the rosters of a fleet, each of the next version (docs/protocol_security.md, "The roster"). It needs the
/// fleet's key and the newest roster only. Sans-I/O: the owner stores `newest`.
///
/// If a function throws, the newest roster is as before.
class fleet_authority {
  public:
    /// A new fleet: version 1, without members.
    static fleet_authority found(signing_key fleet_key);

    /// \throws security_error if the roster is not of that key, contains keys that this version does not know and so
    ///         would drop, or has group keys that cannot be opened
    fleet_authority(signing_key fleet_key, std::shared_ptr<const roster> newest);

    [[nodiscard]] const roster& newest() const noexcept { return *newest_; }
    [[nodiscard]] std::shared_ptr<const roster> share() const noexcept { return newest_; }

    /// Adds nodes, all with these rights. \throws security_error if a name or key is a member's, or is not valid, or
    /// the roster would become too large
    void add(std::span<const public_identity> nodes, const member_rights& rights = {});
    void add(const public_identity& node, const member_rights& rights = {}) { add({&node, 1}, rights); }
    /// \throws security_error if there is no such member
    void set_rights(std::string_view name, const member_rights& rights);
    /// Draws both group keys anew, so that the members that were removed know none. \throws security_error if there is
    /// no such member
    void remove(std::span<const std::string> names);
    void remove(const std::string& name) { remove({&name, 1}); }
    /// Makes the next group key the current one.
    void rotate();

  private:
    struct draft;

    [[nodiscard]] draft next_version() const;
    void publish(const draft& next);

    signing_key key_;
    std::shared_ptr<const roster> newest_;
    group_keys keys_;
};

} // namespace cles::security
