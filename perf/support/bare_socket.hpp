// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include "descriptor.hpp"

#include <cstddef>
#include <cstdint>
#include <span>

/// Blocking sockets without the library, for what it is compared with.
namespace cles::perf {

struct listener {
    descriptor socket;
    url where; ///< with the port that the system chose
};

/// Listens at a `tcp` URL with an IPv4 address, or at a `unix` one; at a `udp` URL the socket gets the datagrams
/// itself. \throws std::system_error, or std::runtime_error for another scheme
listener listen_on(const url& where);
/// Accepts the next connection of a stream. This and `connect_to` set the flags that the library sets on its own
/// sockets.
descriptor accept_from(const listener& at);

/// Connects to a `tcp`, `udp` or `unix` URL. If nothing arrives by `udp` for ten seconds, receiving fails.
/// \throws std::system_error, or std::runtime_error if the host has no address, or for another scheme
descriptor connect_to(const url& where);

/// Of IPv4, not bound. \throws std::system_error
descriptor datagram_socket();

void send_all(int socket, std::span<const std::byte> bytes);
/// False if the peer closed the connection before the first byte. A datagram has to be complete.
bool receive_all(int socket, std::span<std::byte> bytes);

} // namespace cles::perf
