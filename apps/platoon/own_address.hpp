// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>

namespace platoon {

/// The IPv4 address of an interface of this host; 127.0.0.1 where it is loopback, or has none.
std::string own_address(const std::string& interface_name);

} // namespace platoon
