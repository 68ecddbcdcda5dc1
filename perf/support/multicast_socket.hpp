// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "descriptor.hpp"

#include <cstdint>
#include <string>

/// Multicast sockets on the loopback interface, without the library.
namespace cles::perf {

struct multicast_group {
    std::string address = "239.255.25.37";
    std::uint16_t port = 0;
};

/// Reserves a port of a group while this object exists: the system does not choose it for another socket.
class reserved_group {
  public:
    reserved_group();
    [[nodiscard]] const multicast_group& get() const noexcept { return group_; }

  private:
    multicast_group group_;
    descriptor socket_;
};

/// A socket that receives from the group, with the flags and the buffer size that the library sets.
descriptor join(const multicast_group& group);
/// A socket that sends to the group on this host only.
descriptor connect_to(const multicast_group& group);

} // namespace cles::perf
