// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/text_list.hpp>

#include <functional>
#include <string>

/// Joins pools through NATS (docs/federation.md). Link the CMake target cles::federation.

namespace cles {

namespace asio_port {
class asio_environment;
} // namespace asio_port

namespace core {
struct node_options;
} // namespace core

struct federation_options {
    /// URLs of NATS servers, `nats://host:4222` or `tls://host:4222`: of one server, or of several of one cluster.
    text_list servers;
    /// The name of the service's pool: 1 to 32 letters, digits, '_', '-'.
    std::string pool;
    /// A file with the JWT and the key of a user of NATS; empty: none.
    std::string credentials{};
    /// A file whose first line is a token; empty: none.
    std::string token{};
    /// Files for TLS, in PEM: the authorities that are trusted instead of those of the system, and the own
    /// certificate with its key. With either, TLS is required, whatever the URL.
    std::string tls_authority{};
    std::string tls_certificate{};
    std::string tls_key{};
};

/// The bridge of one service, for `service_options::federation`. It starts one thread, which connects to NATS, and
/// connects again whenever the connection is lost; the thread ends when the service is destroyed, which waits for
/// it: up to 200 ms for what is left to send, and while it connects, up to one second for each server, with TLS one
/// more for each message of the handshake, and as long as the system takes to look up its name. The files are read at
/// each connection. The service has to route (`cles::routing`) to serve requests of other pools for other nodes.
/// What crosses NATS is sealed if the service has `service_options::security`; without it, everybody who may publish
/// to NATS can send requests, which `service_options::insecure` has to permit.
///
/// \throws cles::error with `invalid_option` or `invalid_name`
std::function<void(asio_port::asio_environment&, core::node_options&)> federation(federation_options options);

} // namespace cles
