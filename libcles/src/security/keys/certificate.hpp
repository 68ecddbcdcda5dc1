// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/keys.hpp"

namespace cles::security {

/// A private key and its self-signed certificate as PEM, for programs that use TLS without this library. As of the
/// certificate that a node makes when it starts (docs/protocol_security.md, "Streams"), only the public key counts, and
/// it is valid at any time.
[[nodiscard]] secret_bytes to_pem(const signing_key& key);

} // namespace cles::security
