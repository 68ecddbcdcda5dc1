// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "descriptor.hpp"

#include <cstdint>
#include <string>

/// Multicast sockets on the loopback interface, bare.
namespace cles::perf {

struct multicast_group {
    std::string address = "239.255.25.37";
    std::uint16_t port = 0;
};

/// A port of a group that nobody else is given as long as this object lives: those who name it may share it.
class reserved_group {
  public:
    reserved_group();
    [[nodiscard]] const multicast_group& get() const noexcept { return group_; }

  private:
    multicast_group group_;
    descriptor socket_;
};

/// A socket that gets what is sent to the group, with the flags and the buffer that the library gives its own.
descriptor join(const multicast_group& group);
/// A socket whose datagrams go to the group, and no farther than this host.
descriptor connect_to(const multicast_group& group);

} // namespace cles::perf
