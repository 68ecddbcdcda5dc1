// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/keys.hpp"

#include <string>
#include <string_view>

/// Whose a key is, and the lines of key files (docs/protocol_security.md, "The roster"). Each line has exactly one
/// form; readers accept an LF after it.

namespace cles::security {

/// A node's name and public key, which are carried to the authority: `car1.pub`.
struct public_identity {
    std::string name{};
    public_key key{};
};

/// A node's name and private key: `key`.
struct node_identity {
    std::string name;
    signing_key key;

    [[nodiscard]] public_identity public_part() const { return {name, key.public_part()}; }
};

/// What keeps a text from being the name of a node; empty if nothing does.
std::string flaw_of_node_name(std::string_view text);
/// \throws security_error if there is such a flaw
void require_node_name(std::string_view name);

/// A short text by which people compare a name and its key: five groups of four hexadecimal digits.
std::string fingerprint_of(const public_identity& identity);

std::string to_line(const public_identity& identity);
secret_bytes to_line(const node_identity& identity);
secret_bytes fleet_key_line(const signing_key& key);

/// \throws security_error which does not name the file
public_identity read_public_identity(std::string_view line);
node_identity read_node_identity(bytes_view line);
signing_key read_fleet_key(bytes_view line);

} // namespace cles::security
