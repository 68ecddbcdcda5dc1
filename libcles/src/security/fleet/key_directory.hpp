// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/protected_folder.hpp"
#include "security/fleet/roster.hpp"
#include "security/keys/identity.hpp"

#include <memory>
#include <string>
#include <vector>

namespace cles::security {

/// What a node's directory contains.
struct node_credentials {
    node_identity own;
    std::shared_ptr<const roster> newest; ///< contains this node
    std::vector<std::string> warnings{};  ///< to be logged: rosters that are not in force although they are as new
};

/// The directory of a node, or of the authority, with the files of docs/protocol_security.md, "The roster".
///
/// All functions throw `security_error`, which names the file, what is wrong, and what mends it.
class key_directory {
  public:
    /// Opens an existing directory.
    explicit key_directory(std::string path) : folder_(std::move(path)) {}
    /// Creates the directory if it does not exist.
    static key_directory create(std::string path) { return key_directory{protected_folder::create(std::move(path))}; }

    [[nodiscard]] const protected_folder& folder() const noexcept { return folder_; }

    /// Creates `key` with a new private key, and `NAME.pub`. An existing key is never replaced.
    node_identity create_key(const std::string& name) const;
    [[nodiscard]] bool has_key() const;
    [[nodiscard]] node_identity read_key() const;
    /// Writes `NAME.pub`.
    void write_public_identity(const public_identity& identity) const;
    /// Writes `tls.pem`, with the private key and a certificate of it. Replaces an older one.
    void write_certificate(const signing_key& key) const;
    [[nodiscard]] std::string certificate_path() const;
    /// Creates `fleet.key`. An existing one is never replaced.
    void create_fleet_key(const signing_key& key) const;
    [[nodiscard]] signing_key read_fleet_key() const;
    /// Reads a file as `car1.pub`.
    [[nodiscard]] public_identity read_public_identity(const std::string& name) const;

    /// The newest of `roster` and all `*.join`, which must be of one fleet; null if there is none. Where two differ in
    /// one version, `roster` counts, and a warning is added.
    [[nodiscard]] std::shared_ptr<const roster> read_newest_roster(std::vector<std::string>& warnings) const;
    /// All that a node needs.
    [[nodiscard]] node_credentials read_node() const;

    /// Replaces `roster`, unless the file contains a newer or another one of the same version. False then. Several
    /// processes may do so at the same time.
    bool store_roster(const roster& newest) const;
    /// Writes a roster for the node that was added: `NAME.join`.
    void write_join(const std::string& name, const roster& newest) const;

  private:
    explicit key_directory(protected_folder folder) : folder_(std::move(folder)) {}
    [[nodiscard]] std::shared_ptr<const roster> read_roster_file(const std::string& name, const roster* known) const;

    protected_folder folder_;
};

} // namespace cles::security
