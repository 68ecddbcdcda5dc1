// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace sysinfo {

/// One direction of an interface since it came up.
struct traffic {
    std::uint64_t bytes = 0;
    std::uint64_t packets = 0;
    std::uint64_t errors = 0;
    std::uint64_t dropped = 0;
};
BOOST_DESCRIBE_STRUCT(traffic, (), (bytes, packets, errors, dropped))

struct interface_traffic {
    std::string name;
    traffic received;
    traffic sent;
};
BOOST_DESCRIBE_STRUCT(interface_traffic, (), (name, received, sent))

struct network {
    std::vector<interface_traffic> interfaces;
};
BOOST_DESCRIBE_STRUCT(network, (), (interfaces))

/// Reads /proc/net/dev.
network parse_network(std::string_view net_dev);

} // namespace sysinfo
