// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/url.hpp>

#include <charconv>
#include <cstdint>
#include <optional>

namespace cles {
namespace {

[[noreturn]] void refuse(std::string_view text, std::string_view why) {
    throw error(errc::invalid_url, "'" + std::string{text} + "': " + std::string{why});
}

// Nothing: it is not a number from 0 to `highest`.
std::optional<std::uint16_t> parse_number(std::string_view text, std::uint16_t highest) {
    std::uint16_t value = 0;
    const auto end = text.data() + text.size();
    const auto [ptr, code] = std::from_chars(text.data(), end, value);
    return code == std::errc{} && ptr == end && value <= highest ? std::optional{value} : std::nullopt;
}

bool has_only_a_name(std::string_view scheme) { return scheme == "inproc" || scheme == "pool"; }

void parse_host_and_port(std::string_view whole, std::string_view rest, url& out) {
    out.port = default_port;
    if (const auto query = rest.find('?'); query != std::string_view::npos) {
        constexpr std::string_view key = "?dscp=";
        constexpr std::uint16_t highest = 63; // six bits (RFC 2474)
        const auto given = rest.substr(query);
        const auto dscp = given.starts_with(key) ? parse_number(given.substr(key.size()), highest) : std::nullopt;
        if (!dscp) {
            refuse(whole, "only 'dscp=' and a number from 0 to 63 may follow '?'");
        }
        out.dscp = static_cast<std::uint8_t>(*dscp);
        rest = rest.substr(0, query);
    }
    std::string_view after;
    if (rest.starts_with('[')) {
        const auto close = rest.find(']');
        if (close == std::string_view::npos) {
            refuse(whole, "an IPv6 address needs its closing ']'");
        }
        out.host = rest.substr(1, close - 1);
        if (const auto zone = out.host.find("%25"); zone != std::string::npos) {
            out.host.replace(zone, 3, "%");
        }
        if (out.host.find(':') == std::string::npos) {
            refuse(whole, "brackets are for IPv6 addresses");
        }
        after = rest.substr(close + 1);
        if (!after.empty() && after.front() != ':') {
            refuse(whole, "only ':' and a port may follow ']'");
        }
    } else {
        const auto colon = rest.find(':');
        out.host = rest.substr(0, colon);
        after = colon == std::string_view::npos ? std::string_view{} : rest.substr(colon);
        if (after.find(':', 1) != std::string_view::npos) {
            refuse(whole, "an IPv6 address needs brackets, as in tcp://[::1]:25370");
        }
    }
    if (out.host.empty()) {
        refuse(whole, "the host is missing");
    }
    if (out.host.find_first_of("/?#@ ") != std::string::npos || after.find('/') != std::string_view::npos) {
        refuse(whole, "a " + out.scheme + " URL ends after its port, or with ?dscp=...");
    }
    if (!after.empty()) {
        const auto port = parse_number(after.substr(1), UINT16_MAX);
        if (!port) {
            refuse(whole, "the port is not a number from 0 to 65535");
        }
        out.port = *port;
    }
}

} // namespace

url parse_url(std::string_view text) {
    const auto separator = text.find("://");
    if (separator == std::string_view::npos || separator == 0) {
        refuse(text, "a URL begins with a scheme, as in tcp://127.0.0.1:25370");
    }
    url out;
    out.scheme = text.substr(0, separator);
    const auto rest = text.substr(separator + 3);
    if (out.scheme == "unix") {
        constexpr std::size_t longest = 107; // sockaddr_un
        if (rest.size() < 2 || (rest.front() != '/' && rest.front() != '@')) {
            refuse(text, "a Unix socket is an absolute path (unix:///run/car1.sock) or abstract (unix://@car1)");
        }
        if (rest.size() > longest) {
            refuse(text, "a Unix socket's path has at most 107 bytes");
        }
        out.path = rest;
    } else if (has_only_a_name(out.scheme)) {
        if (rest.empty()) {
            refuse(text, "the name is missing");
        }
        out.host = rest;
    } else {
        parse_host_and_port(text, rest, out);
    }
    return out;
}

std::string to_string(const url& u) {
    std::string text = u.scheme + "://";
    if (u.scheme == "unix") {
        return text + u.path;
    }
    if (has_only_a_name(u.scheme)) {
        return text + u.host;
    }
    if (u.host.find(':') != std::string::npos) {
        auto host = u.host;
        if (const auto zone = host.find('%'); zone != std::string::npos) {
            host.replace(zone, 1, "%25");
        }
        text += "[" + host + "]";
    } else {
        text += u.host;
    }
    text += ":" + std::to_string(u.port);
    if (u.dscp) {
        text += "?dscp=" + std::to_string(*u.dscp);
    }
    return text;
}

bool stays_on_host(std::string_view scheme) noexcept { return scheme == "unix" || scheme == "inproc"; }

} // namespace cles
