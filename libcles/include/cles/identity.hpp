// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include <boost/system/error_code.hpp>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace cles {

/// The other end of a link, as far as the transport knows it. Complete when the first line arrives.
struct identity {
    std::string transport;            ///< the scheme of its URL, such as "tcp"; or "multicast"
    std::string address;              ///< as a URL; for clients of a Unix socket, the socket that they connected to
    std::string name;                 ///< the node's authenticated name; empty if the transport authenticates none
    std::optional<std::uint32_t> uid; ///< of the process, if the kernel reports it (Unix sockets)
    bool local = false;               ///< whether it is on this host

    bool operator==(const identity&) const = default;
};

/// The category of the error of a request to a Unix socket where a user listens who is not trusted to be that node. The
/// value is the id of the user. The codes equal `std::errc::permission_denied`.
const boost::system::error_category& untrusted_listener_category() noexcept;

/// A request whose access is to be checked.
struct access {
    const identity& peer; ///< the other end of the link; if the request is forwarded, not the requester
    cles::verb verb;
    std::string_view task;
    std::string_view path; ///< the task and its parameters: "localization/fast"
    /// As `request::requester`: in a secured fleet, the member whose request it is; empty if there is none, and without
    /// security.
    std::string_view requester{};
    std::string_view forwarded_by{}; ///< as `request::forwarded_by`: the member that has forwarded it
};

/// Decides about access. Called before every request from a link is served, including those to the reserved task
/// `cles`; if it returns false, the reply is `denied`. It must neither throw nor block.
using authoriser = std::function<bool(const access&)>;

} // namespace cles
