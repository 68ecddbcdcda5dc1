// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/security/member_rights.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// The directory of a node: its key, the roster, and its local rules (docs/protocol_security.md, "The roster"). For
/// programs that create and show keys; a node itself reads more.
///
/// All functions throw `std::runtime_error` with a message for people, which names the file, what is wrong, and what
/// corrects it. None returns a secret.

namespace cles::security {

/// A node's public part, which is carried to the authority of its fleet.
struct created_key {
    std::string file{};        ///< the path of NAME.pub
    std::string line{};        ///< its content
    std::string fingerprint{}; ///< by which people compare name and key with what has arrived elsewhere
};

struct node_description {
    std::string name{};
    std::string key{};                     ///< the public key
    std::string fingerprint{};             ///< of name and key, as in `created_key`
    std::string fleet{};                   ///< the fleet's public key; empty without a roster
    std::uint32_t version = 0;             ///< of the roster
    std::optional<member_rights> rights{}; ///< nothing if the node is not in the roster
    std::string reason{};                  ///< why it is not
    std::size_t rules = 0;                 ///< how many local rules there are
    std::string rules_error{};             ///< why everything is denied; empty if there is no error
    std::vector<std::string> warnings{};
};

/// Creates a node's private key in its directory, which is created if it does not exist. A key is never replaced.
created_key create_node_key(const std::string& directory, const std::string& name);

[[nodiscard]] node_description describe_node(const std::string& directory);

/// Writes the node's private key and a certificate of it as PEM, for programs that use TLS without this library: the
/// file `tls.pem` in the directory, which only its owner can read. An existing one is replaced.
/// \return the path of the file
std::string write_certificate(const std::string& directory);

/// Stores a roster that contains this node, such as the content of NAME.join.
node_description join_fleet(const std::string& directory, std::string_view roster_line);

} // namespace cles::security
