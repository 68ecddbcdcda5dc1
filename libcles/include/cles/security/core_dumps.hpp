// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::security {

/// From now on, this process leaves no core dump, and no other process of its user can trace it or read its memory. For
/// programs that read private keys. The memory of keys is left out of core dumps without it, but not what is encrypted
/// and decrypted with them. \throws std::system_error
void forbid_core_dumps();

} // namespace cles::security
