// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace cles {

/// Who is at the other end of a link, as far as the transport can tell. Known from the link's first line on.
struct identity {
    std::string transport;            ///< "tcp", "udp", "unix", "inproc", "multicast"
    std::string address;              ///< as a URL; of a Unix socket's client, the socket that it came in by
    std::string name;                 ///< the node's proven name; empty where the transport proves none
    std::optional<std::uint32_t> uid; ///< of the process, where the kernel tells (Unix sockets)
    bool local = false;               ///< on this host
};

/// A request that asks to be served.
struct access {
    const identity& peer;
    cles::verb verb;
    std::string_view task;
    std::string_view path; ///< the task and its parameters: "localization/fast"
};

/// The one place where access is decided. Runs before every request that a link brings, the reserved task's too; false
/// is answered with `denied`. It must neither throw nor block.
using authoriser = std::function<bool(const access&)>;

} // namespace cles
