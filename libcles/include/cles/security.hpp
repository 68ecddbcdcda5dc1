// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

/// Security for services (docs/security.md). Link the CMake target cles::tls.

namespace cles {

namespace asio_port {
class asio_environment;
} // namespace asio_port

namespace core {
struct node_options;
} // namespace core

struct security_options {
    /// The node's directory: its key, the roster of its fleet, and local rules. `cles keys new` and `cles fleet` make
    /// these files.
    std::string directory;
    /// Which members other users of this host are, by user id: when they connect to a Unix socket of the node, and when
    /// the node connects to one of theirs. Root and the user of the process count as the node itself, or as the one
    /// that it connects to; all others are refused.
    std::map<std::uint32_t, std::string> local_users{};
};

/// The security of one service, for `service_options::security`:
///
/// ```
/// cles::service car{io, {.name = "car1", .listen = {"tls://0.0.0.0:25370"}, .security =
/// cles::secured("/var/lib/cles/keys")}};
/// ```
///
/// The service's name must be the one of the key. It listens and connects by `tls`, by `udp` with sealed datagrams, and
/// by Unix sockets, and refuses plain TCP. A `udp` address is for a node that is named, as in `service_options::peers`;
/// an address alone needs `tls`. What it receives from its multicast group must be sealed by a member. Members may do
/// what the roster and the local rules permit; changes of both take effect without a restart.
///
/// \throws cles::error with `denied` if the files cannot be used; the message names the file and what mends it
std::function<void(asio_port::asio_environment&, core::node_options&)> secured(security_options options);
std::function<void(asio_port::asio_environment&, core::node_options&)> secured(const std::string& directory);

} // namespace cles
