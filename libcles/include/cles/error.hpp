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

/// What can go wrong. The first group crosses the wire by name (docs/protocol.md, "Errors"); the second never leaves
/// the process.
enum class errc {
    bad_request = 1, ///< the line, an adverb, the JSON or a parameter is wrong
    denied,          ///< the access rules forbid it
    no_target,       ///< the target is not that node, and no way to it is known
    no_task,         ///< the target does not offer that verb and task
    too_large,       ///< the message or its answer exceeds a limit
    cancelled,       ///< the requester withdrew it
    failed,          ///< the handler failed
    unavailable,     ///< the link or node was lost before the answer: the outcome is unknown
    busy,            ///< refused before it started: queue full or limit reached
    deadline,        ///< the time ran out

    would_deadlock = 100, ///< the blocking form was called from inside a handler
    invalid_url,          ///< not a link address
    unknown_scheme,       ///< no transport is registered for the URL's scheme
    insecure_listen,      ///< listening beyond this host without credentials needs `insecure`
    invalid_name,         ///< not a name that a node or task may bear
    already_registered,   ///< the verb and task have a handler already
    conversion,           ///< JSON does not have the shape of the C++ type
    stopped,              ///< the service has been stopped
    invalid_option,       ///< an option is outside of what it may be; the message names it
    closed,               ///< the feed is not open: never bound, closed, or moved from
};

/// The category of `errc`; its name is "cles". Its codes equal the conditions of `std::errc` and `boost::system::errc`
/// that say the same:
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
/// | `bad_request`, `invalid_url`, `invalid_name` | `invalid_argument` |
/// | `conversion` | `bad_message` |
/// | `would_deadlock` | `resource_deadlock_would_occur` |
/// | `unknown_scheme` | `protocol_not_supported` |
/// | `insecure_listen` | `operation_not_permitted` |
/// | `already_registered` | `file_exists` |
///
/// `failed` is what the handler makes of it, and equals none. With `<cles/service.hpp>` the codes of Asio compare too:
/// `code == boost::asio::error::operation_aborted`.
const boost::system::error_category& error_category() noexcept;

inline boost::system::error_code make_error_code(errc e) noexcept { return {static_cast<int>(e), error_category()}; }

inline bool operator==(errc code, std::errc condition) noexcept { return make_error_code(code) == condition; }
inline bool operator==(errc code, boost::system::errc::errc_t condition) noexcept {
    return make_error_code(code) == condition;
}

/// The name that stands in `{"error":"..."}`; names without a wire form give "failed".
std::string_view wire_name(errc e) noexcept;

/// The code that bears this name on the wire. A name from a newer node counts as `failed`.
errc errc_from_wire(std::string_view name) noexcept;

/// Thrown by a handler to answer with a code of its choice, and thrown to a caller that awaits a request which failed.
///
/// `what()` is the code's name and the message, as in "no_task: car1 has no PULL 'speed'"; with a code of the system,
/// whose text the message holds already, the message alone.
class error : public boost::system::system_error {
  public:
    error(errc code, std::string message);
    error(boost::system::error_code code, std::string message);

    /// The peer's (or the library's) own words, without the code's name.
    [[nodiscard]] const std::string& message() const noexcept { return message_; }
    [[nodiscard]] const char* what() const noexcept override { return what_.c_str(); }

  private:
    std::string message_;
    std::string what_;
};

} // namespace cles

template <>
struct boost::system::is_error_code_enum<cles::errc> : std::true_type {};
