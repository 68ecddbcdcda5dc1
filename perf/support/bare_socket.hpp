// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include "descriptor.hpp"

#include <cstddef>
#include <cstdint>
#include <span>

/// Blocking sockets, bare: for what must not go through the library that it measures.
namespace cles::perf {

struct listener {
    descriptor socket;
    url where; ///< with the port that the system chose
};

/// Listens at a `tcp` URL with an IPv4 address, or at a `unix` one; at a `udp` URL the socket gets the datagrams
/// itself. \throws std::system_error, or std::runtime_error where the scheme is another
listener listen_on(const url& where);
/// Takes the next connection of a stream. This and `connect_to` set the flags that the library sets on its own sockets.
descriptor accept_from(const listener& at);

/// Connects to a `tcp`, `udp` or `unix` URL. Where nothing comes by `udp` for ten seconds, receiving fails.
/// \throws std::system_error, or std::runtime_error where the host has no address or the scheme is another
descriptor connect_to(const url& where);

void send_all(int socket, std::span<const std::byte> bytes);
/// False where the peer ended before the first byte. A datagram has to be whole.
bool receive_all(int socket, std::span<std::byte> bytes);

} // namespace cles::perf
