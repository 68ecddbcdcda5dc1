// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_port.hpp"

#include <string>
#include <vector>

namespace cles::transport {

/// \throws boost::system::system_error if there is none of that name, or it is down or has no IPv4 address
core::network_interface find_interface(const std::string& name);

/// All interfaces, by index. \throws boost::system::system_error if the system does not list them
std::vector<core::network_interface> interfaces_of_host();

} // namespace cles::transport
