// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/keys.hpp"
#include "security/keys/secret.hpp"

#include <cstddef>
#include <string>
#include <string_view>

namespace cles::security {

inline constexpr std::size_t group_key_size = 32;

/// The group keys of a roster (docs/security.md, "Group keys").
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

} // namespace cles::security
