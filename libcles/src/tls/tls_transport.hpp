// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "security/fleet/fleet.hpp"
#include "security/link_admission.hpp"
#include "security/refused_link.hpp"

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles::tls {

struct tls_options {
    std::shared_ptr<security::fleet> fleet; ///< of the node; used on the executor of its links
    std::string epoch;                      ///< of the node
    /// Receives each link that was refused, and why.
    std::function<void(const security::refused_link&)> report{};
    /// For the handshake and the admission.
    std::chrono::milliseconds time_to_open = std::chrono::seconds{5};
    /// How many handshakes with those that open links may be begun.
    security::admission_terms::handshake_turns::bounds handshakes = security::admission_terms::usual_handshakes;
};

/// `tls://host:port` for one node (docs/protocol_security.md, "Streams"). The peer of a link is the member that its key
/// belongs to, and the link ends when the roster no longer has that member, or this node. \throws
/// security::security_error if OpenSSL refuses the key
std::unique_ptr<link_transport> make_tls_transport(tls_options options);

} // namespace cles::tls
