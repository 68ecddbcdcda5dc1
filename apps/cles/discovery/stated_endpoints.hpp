// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// Whether a URL leads to another host.
bool is_elsewhere(std::string_view url);

/// The addresses at which a node says that it listens, as they are of use here. If it was asked on another host,
/// `0.0.0.0` and `[::]`, which mean all of its addresses of IPv4 and of IPv6, become the host of `asked` if that is one
/// of them, and addresses that are of use there only follow the others.
std::vector<std::string> endpoints_from_here(std::string_view asked, std::vector<std::string> stated);

/// The same for other nodes that it knows: addresses that are of use there only are left out.
std::vector<std::string> known_endpoints_from_here(std::string_view asked, std::vector<std::string> stated);

} // namespace tool
