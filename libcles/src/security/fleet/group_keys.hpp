// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/keys.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace cles::security {

class roster;

inline constexpr std::size_t group_key_size = 32;

/// The group keys of a roster (docs/protocol_security.md, "Group keys").
struct group_keys {
    secret_bytes current{}; ///< of `roster::generation`
    secret_bytes next{};    ///< of the next one

    static group_keys random();
};

/// Seals group keys for one receiver, as a roster contains them.
std::string seal_group_keys(const group_keys& keys, const agreement_key& receiver);

/// Whether the text has the form of sealed group keys.
bool is_sealed_group_keys(std::string_view text);

/// Opens group keys. \throws security_error if they are not for this key
group_keys open_group_keys(std::string_view sealed, const signing_key& receiver);

/// The group keys that a node has: those of the roster in force, and the previous one where the roster permits it
/// (docs/protocol_security.md, "Group keys").
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
