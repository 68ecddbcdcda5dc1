// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "gateway/http/message.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

namespace gateway {

enum class place : std::uint8_t {
    fleet,   ///< a request of the language: /pull/car1/localization
    session, ///< /session: exchanges a token for a cookie
    metrics, ///< /metrics
    openapi, ///< /openapi.json
    page,    ///< any other path: what is embedded in the program
};

/// Where a request leads.
struct route {
    place to = place::page;
    std::string path{}; ///< of a page
    cles::verb verb = cles::verb::pull;
    std::string noun{};
    std::string target{};               ///< the node that the noun names
    std::chrono::milliseconds every{0}; ///< of BIND
    std::uint32_t keep = 0;             ///< of BIND
};

/// Of a noun in a path.
inline constexpr std::size_t most_parameters = 32;

/// How clients request a verb: GET /pull/...
struct verb_path {
    std::string_view name;
    cles::verb verb;
    std::string_view method;
};
/// \param verb "PULL" \return null if clients cannot request it
const verb_path* find_verb_path(std::string_view verb) noexcept;

/// Whether a node or a task may have this name in a path.
bool is_node_or_task(std::string_view text) noexcept;

/// The verb is in the path and decides on the method, so that nothing is repeated that must not be: caches, proxies and
/// browsers repeat GET only.
std::variant<route, refusal> route_of(std::string_view method, std::string_view target);

/// The time limit in the field `Cles-Deadline`, in milliseconds; 0 if there is none.
std::variant<std::chrono::milliseconds, refusal> deadline_of(const http_request& request);

/// The body of a request of the language, on one line; empty if there is none.
std::variant<std::string, refusal> body_of(const http_request& request);

} // namespace gateway
