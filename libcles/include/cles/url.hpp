// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cles {

inline constexpr std::uint16_t default_port = 25370;

/// The address of a link, in parts.
///
/// ```
/// url      = ( "tcp://" / "tls://" / "udp://" ) host [ ":" port ] [ "?dscp=" number ]
///          / "unix://" path / "inproc://" name / "pool://" name
/// host     = IPv4 address / "[" IPv6 address [ "%25" zone ] "]" / host name
/// path     = "/" ... (a socket file) / "@" ... (an abstract socket)
/// ```
///
/// The default port is 25370; port 0 makes the system choose a free one when listening. A DSCP (RFC 2474) is set in
/// every packet that this end sends on the link, so that the network can prioritise links.
struct url {
    std::string scheme;
    std::string host; ///< of `tcp`, `tls` and `udp`, without brackets; of `inproc` and `pool`, the name
    std::uint16_t port = 0;
    std::string path;                   ///< of `unix`
    std::optional<std::uint8_t> dscp{}; ///< of `tcp`, `tls` and `udp`: 0 to 63
};

/// \throws cles::error with `invalid_url`, saying what is wrong
url parse_url(std::string_view text);

std::string to_string(const url& u);

/// Whether links of that scheme never leave a host, as those of `unix` and `inproc`. URLs of it mean nothing elsewhere.
bool stays_on_host(std::string_view scheme) noexcept;

} // namespace cles
