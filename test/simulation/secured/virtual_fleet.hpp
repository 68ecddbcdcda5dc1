// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/fleet_authority.hpp"
#include "security/fleet/key_directory.hpp"
#include "support/temporary_folder.hpp"

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cles::simulation {

/// The authority of a simulated fleet, and the directories of its nodes. What nodes store there stays when they crash.
class virtual_fleet {
  public:
    /// All are members, with all rights, and have the first roster.
    explicit virtual_fleet(std::vector<std::string> names);
    virtual_fleet(const virtual_fleet&) = delete;
    virtual_fleet& operator=(const virtual_fleet&) = delete;

    [[nodiscard]] std::string directory_of(std::size_t node) const;
    [[nodiscard]] const security::roster& newest() const noexcept { return authority_->newest(); }
    [[nodiscard]] std::shared_ptr<const security::roster> share() const noexcept { return authority_->share(); }
    [[nodiscard]] bool is_member(std::size_t node) const { return newest().find(names_[node]) != nullptr; }

    void rotate() { authority_->rotate(); }
    /// At least two stay.
    void remove(std::size_t node);
    void add(std::size_t node);
    void set_rights(std::size_t node, const security::member_rights& rights);
    /// Writes the newest roster to a node's directory, as an operator does.
    void give(std::size_t node) const;
    /// Makes two rosters of the next version, and gives each to one node.
    void fork(std::size_t one, std::size_t other);
    /// All are members again, and may do everything.
    void restore();
    /// A planted fault: the directory of a node has the first roster again.
    void roll_back(std::size_t node) const;

  private:
    void write(std::size_t node, const security::roster& which) const;

    std::vector<std::string> names_;
    test::temporary_folder folder_;
    std::vector<security::public_identity> identities_;
    security::signing_key key_;
    std::optional<security::fleet_authority> authority_;
    std::string first_; // the line of the first roster
};

} // namespace cles::simulation
