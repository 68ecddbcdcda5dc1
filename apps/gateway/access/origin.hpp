// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "gateway/http/message.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace gateway {

/// From where the gateway may be used.
struct origin_rules {
    std::vector<std::string> hosts{};   ///< names in `Host`, in small letters, besides localhost and addresses
    std::vector<std::string> origins{}; ///< other origins that may use it, as in "https://fleet.example"
    bool is_tls = false;
    bool is_behind_proxy = false; ///< which may use TLS, or not
};

/// Whether the request is for this host. A page whose name has been made to lead here afterwards (DNS rebinding) is of
/// its own origin to the browser, but its requests have its name in `Host`, which is not one of ours. An address cannot
/// be made to lead elsewhere.
bool is_own_host(const origin_rules& rules, std::string_view host) noexcept;

enum class origin : std::uint8_t {
    none,    ///< not of a page, or of one that the gateway has served
    own,     ///< of a page that the gateway has served
    allowed, ///< of another one that may use it
    foreign,
};
origin origin_of(const origin_rules& rules, const http_request& request) noexcept;

/// Why the request is refused for its host or its origin; nothing if it is not. \param is_page it asks for a page of
/// the gateway, to which others may lead
std::optional<refusal> origin_refusal(const origin_rules& rules, const http_request& request, bool is_page);

/// The fields by which a browser passes the response to a page of an origin that is allowed; none for others.
header_fields cors_fields(const origin_rules& rules, const http_request& request);

/// The response to the request with which a browser asks whether a page may send one (OPTIONS).
http_response preflight(const origin_rules& rules, const http_request& request);

} // namespace gateway
