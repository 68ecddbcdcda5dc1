// SPDX-License-Identifier: BSL-1.0
#include "discovery/stated_endpoints.hpp"

#include <cles/error.hpp>
#include <cles/url.hpp>

#include "discovery/host.hpp"

#include <algorithm>
#include <optional>

namespace tool {
namespace {

// Nothing if it cannot be read, as that of a newer node.
std::optional<cles::url> parsed(std::string_view url) {
    try {
        return cles::parse_url(url);
    } catch (const cles::error&) {
        return std::nullopt;
    }
}

bool is_loopback(const std::string& host) { return host.starts_with("127.") || host == "::1" || host == "localhost"; }
bool is_unspecified(const std::string& host) { return host == "0.0.0.0" || host == "::"; }

// Whether it is of use on the host of its node only.
bool stays_there(const std::string& endpoint) {
    const auto where = parsed(endpoint);
    return where && (cles::stays_on_host(where->scheme) || is_loopback(where->host) || is_unspecified(where->host));
}

// Nodes listen for IPv4 and IPv6 separately. A name may stand for addresses of both.
bool can_stand_for(const std::string& host, const std::string& unspecified) {
    const bool is_v6 = host.find(':') != std::string::npos;
    const bool is_v4 = host.find_first_not_of("0123456789.") == std::string::npos;
    return unspecified == "::" ? !is_v4 : !is_v6;
}

std::vector<std::string> with_host(const std::string& host, std::vector<std::string> stated) {
    for (auto& endpoint : stated) {
        if (auto where = parsed(endpoint); where && is_unspecified(where->host) && can_stand_for(host, where->host)) {
            where->host = host;
            endpoint = to_string(*where);
        }
    }
    return stated;
}

} // namespace

bool is_elsewhere(std::string_view url) {
    const auto where = parsed(url);
    return where && !cles::stays_on_host(where->scheme) && !is_own_host(where->host);
}

std::vector<std::string> endpoints_from_here(std::string_view asked, std::vector<std::string> stated) {
    if (!is_elsewhere(asked)) {
        return stated;
    }
    auto out = with_host(parsed(asked)->host, std::move(stated));
    std::stable_partition(out.begin(), out.end(), [](const std::string& endpoint) { return !stays_there(endpoint); });
    return out;
}

std::vector<std::string> known_endpoints_from_here(std::string_view asked, std::vector<std::string> stated) {
    if (is_elsewhere(asked)) {
        std::erase_if(stated, stays_there);
    }
    return stated;
}

} // namespace tool
