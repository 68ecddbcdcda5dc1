// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include <boost/system/error_code.hpp>

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace gateway {

using header_fields = std::vector<std::pair<std::string, std::string>>;

/// A request as its client has sent it.
struct http_request {
    std::string method{};
    std::string target{};
    header_fields fields{}; ///< their names in small letters
    std::string body{};
    bool keep_alive = false; ///< whether further requests may follow on the connection

    /// The value of the first field of that name; empty if there is none.
    [[nodiscard]] std::string_view field(std::string_view name) const noexcept;
    [[nodiscard]] std::size_t count(std::string_view name) const noexcept;
};

/// Why a request is not served.
struct refusal {
    int status = 400;
    std::string message{};
    header_fields fields{};
};

struct http_response {
    int status = 200;
    std::string type = "application/json";
    std::string body{};
    header_fields fields{};       ///< besides those that every response has
    std::string_view permanent{}; ///< instead of the body, what is there as long as the program: it is not copied
};

/// The response to a request that is refused: a failure, as nodes write them.
http_response response_of(const refusal& why);
/// The response to a request that has failed. \param failure as a node has replied it; empty: it has not
http_response response_to_failure(boost::system::error_code code, std::string_view message, std::string_view failure,
                                  header_fields fields);
/// The response as it is sent, up to what is permanent of it. \param has_body false for HEAD, whose client takes what
/// follows for the next response
std::string to_text(const http_response& response, bool keep_alive, bool has_body = true);
/// What precedes a stream of server-sent events, which ends with the connection.
std::string event_stream_head(const header_fields& fields);

/// The HTTP status of each failure that nodes reply, as in docs/protocol.md ("Errors").
struct coded_status {
    cles::errc code;
    int status;
};
inline constexpr std::array statuses{
    coded_status{cles::errc::bad_request, 400}, coded_status{cles::errc::denied, 403},
    coded_status{cles::errc::no_target, 404},   coded_status{cles::errc::no_task, 404},
    coded_status{cles::errc::too_large, 413},   coded_status{cles::errc::cancelled, 499},
    coded_status{cles::errc::failed, 500},      coded_status{cles::errc::unavailable, 502},
    coded_status{cles::errc::busy, 503},        coded_status{cles::errc::deadline, 504},
};
/// The code with which a failure of this process, or of the system, is told: one that nodes reply.
cles::errc told_code(boost::system::error_code failure) noexcept;
/// {"error":"no_task","message":"car1 has no PULL 'speed'"}
std::string failure_text(cles::errc code, std::string_view message);

/// The text as JSON, in quotation marks.
std::string json_string(std::string_view text);
std::string small_letters(std::string_view text);
/// Without spaces and tabs at its ends.
std::string_view trimmed(std::string_view text) noexcept;
/// The part of a list up to the separator, trimmed; it is removed from the list.
std::string_view take_part(std::string_view& list, char separator) noexcept;

} // namespace gateway
