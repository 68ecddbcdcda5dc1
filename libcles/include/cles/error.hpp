// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/standard.hpp>

#include <boost/system/error_code.hpp>
#include <boost/system/system_error.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <system_error>

namespace cles {

/// Error codes. The first group is sent to peers by name (docs/protocol.md, "Errors"); the second never leaves the
/// process.
enum class errc {
    bad_request = 1, ///< the line, an adverb, the JSON or a parameter is wrong
    denied,          ///< the access rules forbid it
    no_target,       ///< the target is not that node, and no route to it is known
    no_task,         ///< the target does not offer that verb and task
    too_large,       ///< the message or its reply exceeds a limit
    cancelled,       ///< the requester cancelled it
    failed,          ///< the handler failed
    unavailable,     ///< the link or node was lost before the reply: the outcome is unknown
    busy,            ///< refused before it started: queue full or limit reached
    deadline,        ///< the deadline passed

    would_deadlock = 100, ///< a blocking function was called where it would deadlock, such as inside a handler
    invalid_url,          ///< not a link address
    unknown_scheme,       ///< no transport is registered for the URL's scheme
    insecure_listen,      ///< listening beyond this host without credentials needs `insecure`
    invalid_name,         ///< not a valid name of a node or task
    already_registered,   ///< the verb and task have a handler already
    conversion,           ///< JSON does not have the shape of the C++ type
    stopped,              ///< the service has been stopped
    invalid_option,       ///< an option is out of range; the message names it
    closed,               ///< the feed is not open: never bound, closed, or moved from
};

/// The category of `errc`; its name is "cles". Its codes equal the corresponding conditions of `std::errc` and
/// `boost::system::errc`:
///
/// | | |
/// | --- | --- |
/// | `cancelled`, `stopped` | `operation_canceled` |
/// | `deadline` | `timed_out` |
/// | `busy` | `resource_unavailable_try_again`, `device_or_resource_busy` |
/// | `unavailable` | `connection_reset`, `connection_aborted` |
/// | `no_target` | `host_unreachable` |
/// | `no_task` | `operation_not_supported` |
/// | `denied` | `permission_denied` |
/// | `too_large` | `message_size` |
/// | `bad_request`, `invalid_url`, `invalid_name`, `invalid_option` | `invalid_argument` |
/// | `conversion` | `bad_message` |
/// | `would_deadlock` | `resource_deadlock_would_occur` |
/// | `unknown_scheme` | `protocol_not_supported` |
/// | `insecure_listen` | `operation_not_permitted` |
/// | `already_registered` | `file_exists` |
/// | `closed` | `bad_file_descriptor` |
///
/// `failed` equals none, because its meaning depends on the handler. With `<cles/service.hpp>`, codes also compare with
/// those of Asio: `code == boost::asio::error::operation_aborted`.
const boost::system::error_category& error_category() noexcept;

inline boost::system::error_code make_error_code(errc e) noexcept { return {static_cast<int>(e), error_category()}; }

inline bool operator==(errc code, std::errc condition) noexcept { return make_error_code(code) == condition; }
inline bool operator==(errc code, boost::system::errc::errc_t condition) noexcept {
    return make_error_code(code) == condition;
}

/// The name in `{"error":"..."}`; "failed" for codes that are not sent to peers.
std::string_view wire_name(errc e) noexcept;

/// The code with this name on the wire; `failed` if the name is unknown, for example from a newer node.
errc errc_from_wire(std::string_view name) noexcept;

/// Thrown by a handler to reply with a specific code, and thrown to callers that await a request which failed.
///
/// `what()` is the code's name and the message, as in "no_task: car1 has no PULL 'speed'". For a system error code,
/// whose text is part of the message, it is the message alone.
class error : public boost::system::system_error {
  public:
    error(errc code, std::string message);
    error(boost::system::error_code code, std::string message);

    /// The peer's or the library's message, without the code's name. That of a peer is `printable`.
    [[nodiscard]] const std::string& message() const noexcept { return message_; }
    [[nodiscard]] const char* what() const noexcept override { return what_.c_str(); }

  private:
    std::string message_;
    std::string what_;
};

} // namespace cles

template <>
struct boost::system::is_error_code_enum<cles::errc> : std::true_type {};
