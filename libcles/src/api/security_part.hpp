// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <memory>

namespace cles::asio_port {
class asio_environment;
}

namespace cles::core {
class node_security;
}

namespace cles::detail {

/// What `cles::secured` returns: the security of one service. An interface, so that programs without security do not
/// link it.
class security_part {
  public:
    security_part() = default;
    security_part(const security_part&) = delete;
    security_part& operator=(const security_part&) = delete;
    virtual ~security_part() = default;

    /// Adds its transports to the service's environment. Called once. \throws cles::error
    virtual std::shared_ptr<core::node_security> equip(asio_port::asio_environment& environment,
                                                       std::uint32_t epoch) = 0;
};

} // namespace cles::detail
