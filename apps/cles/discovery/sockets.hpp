// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace tool {

/// The program of this host that listens at that port, as "nginx (process 812)"; empty where the system does not tell,
/// as of another user's programs.
/// \param protocol "tcp" or "udp"
std::string holder_of(std::string_view protocol, std::uint16_t port);

} // namespace tool
