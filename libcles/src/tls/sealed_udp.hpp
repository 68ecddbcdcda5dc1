// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "security/datagrams/sealed_datagrams.hpp"

#include <memory>

namespace cles::tls {

/// `udp://host:port` for one node with security (docs/security.md, "Datagrams"): each link is to one member, in
/// sessions. A link can only be dialled to a member that is named.
std::unique_ptr<link_transport> make_sealed_udp(std::shared_ptr<security::fleet> fleet,
                                                std::shared_ptr<security::sealed_datagrams> all);

} // namespace cles::tls
