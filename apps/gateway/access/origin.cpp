// SPDX-License-Identifier: BSL-1.0
#include "gateway/access/origin.hpp"

#include <algorithm>

namespace gateway {
namespace {

// Without the port: "[::1]" of "[::1]:25380"; empty if it is malformed.
std::string_view name_in(std::string_view host) noexcept {
    const auto end = host.starts_with('[') ? std::min(host.find(']'), host.size()) : std::size_t{0};
    const auto colon = std::min(host.find(':', end), host.size());
    const auto port = host.substr(colon);
    const bool good =
        port.size() != 1 && port.size() <= 6 &&
        port.substr(std::min<std::size_t>(1, port.size())).find_first_not_of("0123456789") == std::string_view::npos;
    return good ? host.substr(0, colon) : std::string_view{};
}

bool is_address(std::string_view name) noexcept {
    if (name.starts_with('[')) {
        return name.ends_with(']') &&
               name.substr(1, name.size() - 2).find_first_not_of("0123456789abcdef:.") == std::string_view::npos;
    }
    return !name.empty() && name.find_first_not_of("0123456789.") == std::string_view::npos;
}

bool contains_text(const std::vector<std::string>& all, std::string_view text) noexcept {
    return std::ranges::find(all, text) != all.end();
}

} // namespace

bool is_own_host(const origin_rules& rules, std::string_view host) noexcept {
    const auto name = name_in(host);
    return is_address(name) || name == "localhost" || contains_text(rules.hosts, name);
}

origin origin_of(const origin_rules& rules, const http_request& request) noexcept {
    if (request.count("origin") == 0) {
        return origin::none;
    }
    const auto stated = request.field("origin");
    const auto host = request.field("host");
    constexpr std::string_view plain = "http://";
    constexpr std::string_view encrypted = "https://";
    const bool is_plain = stated.starts_with(plain) && (!rules.is_tls || rules.is_behind_proxy);
    const bool is_encrypted = stated.starts_with(encrypted) && (rules.is_tls || rules.is_behind_proxy);
    const auto rest = stated.substr(std::min(is_encrypted ? encrypted.size() : plain.size(), stated.size()));
    if (request.count("origin") == 1 && (is_plain || is_encrypted) && rest == host) {
        return origin::own;
    }
    return request.count("origin") == 1 && contains_text(rules.origins, stated) ? origin::allowed : origin::foreign;
}

std::optional<refusal> origin_refusal(const origin_rules& rules, const http_request& request, bool is_page) {
    const auto host = small_letters(request.field("host"));
    if (request.count("host") != 1 || !is_own_host(rules, host)) {
        return refusal{.status = 421,
                       .message =
                           "this gateway does not have the name in Host: state it with --host, if it is one of its",
                       .fields = {}};
    }
    const auto from = origin_of(rules, request);
    if (from == origin::foreign) {
        return refusal{.status = 403,
                       .message =
                           "pages of this origin may not use the gateway: state it with --allow-origin, if it may",
                       .fields = {}};
    }
    // Browsers state no origin with requests for images, scripts and the like, but where they come from. Behind a
    // proxy, it tells a page that was served in the clear from the one that TLS protects.
    const auto site = request.field("sec-fetch-site");
    if (from != origin::allowed && !is_page && (site == "cross-site" || site == "same-site")) {
        return refusal{
            .status = 403, .message = "pages of other origins may not embed what is served here", .fields = {}};
    }
    return std::nullopt;
}

header_fields cors_fields(const origin_rules& rules, const http_request& request) {
    if (origin_of(rules, request) != origin::allowed) {
        return {};
    }
    return {{"Access-Control-Allow-Origin", std::string{request.field("origin")}},
            {"Access-Control-Expose-Headers", "Retry-After"},
            {"Vary", "Origin"}};
}

http_response preflight(const origin_rules& rules, const http_request& request) {
    if (auto why = origin_refusal(rules, request, false)) {
        return response_of(*why);
    }
    http_response made{.status = 204, .body = {}, .fields = cors_fields(rules, request)};
    if (!made.fields.empty()) {
        made.fields.emplace_back("Access-Control-Allow-Methods", "GET, POST, DELETE");
        made.fields.emplace_back("Access-Control-Allow-Headers",
                                 "authorization, content-type, cles-deadline, traceparent, last-event-id");
        made.fields.emplace_back("Access-Control-Max-Age", "600");
    }
    return made;
}

} // namespace gateway
