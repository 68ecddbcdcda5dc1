// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/access/local_rules.hpp"
#include "security/access/rights.hpp"
#include "security/fleet/roster.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace cles::security {

/// Whether something is allowed, and what decides it.
struct access_decision {
    enum class cause : std::uint8_t {
        permitted,         ///< by the rights of both members, and by no rule denied
        exempt,            ///< a noun for which rights and rules do not count
        unknown_requester, ///< not in the roster
        unknown_target,    ///< not in the roster
        unknown_forwarder, ///< not in the roster
        not_forwarded,     ///< by the node that forwards: it may not forward for the requester
        rules_unreadable,  ///< the local rules have an error, or cannot be read
        rule,              ///< `rule` denies it
        may,               ///< no right of the requester permits it
        offers,            ///< no right of the target permits it
    };

    cause by = cause::permitted;
    const local_rules::rule* rule = nullptr; ///< the rule that matches, also one with `allow`
    std::int32_t may = rights::nothing;      ///< the right of the requester that permits it, see `rights::find`
    std::int32_t offers = rights::nothing;   ///< the same of the target

    [[nodiscard]] bool allowed() const noexcept { return by == cause::permitted || by == cause::exempt; }
};

/// Who may request what of whom, by the rights in a roster and by the local rules of one node
/// (docs/protocol_security.md, "Rights"). Immutable: made anew when either changes. A decision allocates nothing, and
/// is valid as long as the policy.
///
/// The target of each noun is the node that serves: this one, the one to which a request is forwarded or sent, or the
/// publisher. A `forwarder` is the node that states the requester, or that would; empty for none.
class access_policy {
  public:
    /// \param own_name of this node
    /// \param members those of the roster in force
    access_policy(std::string own_name, std::shared_ptr<const std::vector<member>> members, local_rules rules);
    access_policy(std::string own_name, const std::shared_ptr<const roster>& in_force, local_rules rules);

    /// A request that has arrived here, to be executed or forwarded. Also an update that would be delivered, to a
    /// subscriber on a link or to one behind the node that forwards: then the verb is BIND.
    [[nodiscard]] access_decision received(std::string_view requester, std::string_view forwarder, verb asked,
                                           const decoded_noun& noun) const noexcept;
    /// A request of this node itself, before it is sent. Also an update for it: then the verb is BIND.
    [[nodiscard]] access_decision sent(std::string_view forwarder, verb asked, const decoded_noun& noun) const noexcept;

    /// Whether that member may forward for the other one. Each may state its own name.
    [[nodiscard]] bool may_forward(std::string_view forwarder, std::string_view requester) const noexcept;

    [[nodiscard]] const std::string& own_name() const noexcept { return own_name_; }
    [[nodiscard]] const std::vector<member>& members() const noexcept { return *members_; }
    [[nodiscard]] const local_rules& rules() const noexcept { return rules_; }

  private:
    struct entry {
        rights may;
        rights offers;
        std::vector<std::string_view> forwards; // valid patterns
    };

    [[nodiscard]] const entry* find(std::string_view name) const noexcept;
    [[nodiscard]] access_decision decide(std::string_view requester, std::string_view forwarder, verb asked,
                                         const decoded_noun& noun, bool is_own) const noexcept;

    std::string own_name_;
    std::shared_ptr<const std::vector<member>> members_;
    local_rules rules_;
    std::vector<entry> entries_;                                // as `members_`
    std::unordered_map<std::string_view, std::size_t> by_name_; // their indices
};

} // namespace cles::security
