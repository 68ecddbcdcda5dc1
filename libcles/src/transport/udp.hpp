// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include <memory>

namespace cles::transport {

/// `udp://host:port`: requests, replies and updates as one datagram each.
std::unique_ptr<link_transport> make_udp();

} // namespace cles::transport
