// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/group_keys.hpp"
#include "security/fleet/roster.hpp"

#include <cstdint>
#include <map>

namespace cles::security {

/// The group keys that a node has: those of the roster in force, and the previous one where the roster permits it
/// (docs/security.md, "Group keys").
class group_key_ring {
  public:
    /// Adds the keys of a newer roster, and forgets those of other generations, except the previous one if it is
    /// accepted.
    void adopt(const roster& in_force, group_keys keys);
    /// Forgets all keys.
    void clear() noexcept;
    /// The generation with which this node sends; 0 if there is none.
    [[nodiscard]] std::uint32_t current() const noexcept { return current_; }
    /// Null if the generation is refused or not known.
    [[nodiscard]] const secret_bytes* find(std::uint32_t generation) const;
    /// Whether the generation is later than any that this node can know: a newer roster exists.
    [[nodiscard]] bool is_future(std::uint32_t generation) const noexcept { return generation > current_ + 1; }

  private:
    std::uint32_t current_ = 0;
    std::map<std::uint32_t, secret_bytes> keys_;
};

} // namespace cles::security
