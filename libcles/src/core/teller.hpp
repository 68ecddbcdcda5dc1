// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include "port/group_source.hpp"

#include <string>
#include <string_view>

namespace cles::core {

/// Who says where a node is: by the host from which that is heard, an address that is unspecified gets its meaning.
struct teller {
    std::string host;   ///< an IP address without brackets; empty where it is known by no address
    bool local = false; ///< on this host, so that what only this host can reach is of use

    static teller of(const group_source& from) { return {host_text(from), from.is_loopback()}; }
    /// At the other end of a link.
    static teller of(const identity& peer);
    /// Who was asked at that URL.
    static teller at(std::string_view url);
};

/// The host of a peer's address. Of an address that is not a URL it is the whole text, which is empty where the peer
/// was gone before the system could say whose connection it was.
std::string host_of(const identity& peer);

} // namespace cles::core
