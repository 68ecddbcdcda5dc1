// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::asio_port {
class asio_environment;
}

namespace cles::core {
struct node_options;
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

    /// Adds its transports to the service's environment, and itself to the settings of the node. Called once.
    /// \throws cles::error
    virtual void equip(asio_port::asio_environment& environment, core::node_options& node) = 0;
};

} // namespace cles::detail
