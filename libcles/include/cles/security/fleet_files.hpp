// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/security/member_rights.hpp>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

/// The directory of a fleet's authority: the fleet's key and the newest roster (docs/protocol_security.md, "The
/// roster"). Each change makes a roster of the next version.
///
/// All functions throw `std::runtime_error` with a message for people. If they do, nothing has changed, unless several
/// files are written and only some of them could be. None returns a secret.

namespace cles::security {

struct fleet_member {
    std::uint32_t number = 0;
    std::string name{};
    std::string key{}; ///< the public key
    member_rights rights{};
};

struct fleet_description {
    std::string fleet{}; ///< the fleet's public key
    std::uint32_t version = 0;
    std::uint32_t generation = 0; ///< of the current group key
    std::uint32_t oldest = 0;     ///< the oldest one that is still accepted
    std::vector<fleet_member> members{};
    std::string line{}; ///< the roster itself
    std::vector<std::string> warnings{};
};

/// Creates a fleet without members, in a directory that is created if it does not exist.
fleet_description create_fleet(const std::string& directory);

/// Needs only the roster, also that of a node.
[[nodiscard]] fleet_description describe_fleet(const std::string& directory);

/// The node's name in such a line as NAME.pub contains. Throws if the line or its key is not valid.
[[nodiscard]] std::string name_in_public_line(const std::string& line);
/// A short text by which people compare the name and the key in such a line with those at the node, as in
/// `node_description::fingerprint`. Throws as above.
[[nodiscard]] std::string fingerprint_in_public_line(const std::string& line);

/// Adds the nodes of these lines, which are the contents of NAME.pub, and writes NAME.join for each.
/// \return the paths of these files
std::vector<std::string> add_members(const std::string& directory, const std::vector<std::string>& public_lines,
                                     const member_rights& rights);

/// \param change called with the rights that the member has, and changes them
/// \return the rights that it has now
member_rights change_rights(const std::string& directory, const std::string& name,
                            const std::function<void(member_rights&)>& change);

/// Removes members, and replaces both group keys.
void remove_members(const std::string& directory, const std::vector<std::string>& names);

/// Makes the next group key the current one.
void rotate_group_keys(const std::string& directory);

} // namespace cles::security
