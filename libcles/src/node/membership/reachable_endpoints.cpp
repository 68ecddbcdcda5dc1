// SPDX-License-Identifier: BSL-1.0
#include "node/membership/reachable_endpoints.hpp"

#include <cles/error.hpp>
#include <cles/url.hpp>

#include "json/characters.hpp"

#include <boost/container/static_vector.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace cles::core {
namespace {

/// The kinds of IP addresses that are treated differently.
enum class host_kind { none, ordinary, unspecified, loopback };

host_kind kind_of_ipv4(std::string_view host) noexcept {
    std::uint32_t address = 0;
    for (int field = 0; field < 4; ++field) {
        if (field > 0) {
            if (host.empty() || host.front() != '.') {
                return host_kind::none;
            }
            host.remove_prefix(1);
        }
        std::uint32_t value = 0;
        std::size_t digits = 0;
        while (digits < host.size() && digits < 4 && json_detail::is_digit(host[digits])) {
            value = value * 10 + static_cast<std::uint32_t>(host[digits++] - '0');
        }
        if (digits == 0 || value > 255 || (digits > 1 && host.front() == '0')) {
            return host_kind::none;
        }
        host.remove_prefix(digits);
        address = address << 8U | value;
    }
    if (!host.empty() || address >= 0xE0000000U) { // multicast, reserved and broadcast addresses
        return host_kind::none;
    }
    return address == 0 ? host_kind::unspecified : address >> 24U == 127 ? host_kind::loopback : host_kind::ordinary;
}

using groups = boost::container::static_vector<std::uint16_t, 8>;

/// Reads groups of hex digits, separated by ':'.
bool read_groups(std::string_view text, groups& out) noexcept {
    while (!text.empty()) {
        std::uint16_t value = 0;
        const auto* end = text.data() + std::min<std::size_t>(text.size(), 4);
        const auto [rest, code] = std::from_chars(text.data(), end, value, 16);
        if (code != std::errc{} || out.size() == out.capacity()) {
            return false;
        }
        out.push_back(value);
        text.remove_prefix(static_cast<std::size_t>(rest - text.data()));
        if (!text.empty()) {
            if (text.front() != ':' || text.size() == 1) {
                return false;
            }
            text.remove_prefix(1);
        }
    }
    return true;
}

host_kind kind_of_ipv6(std::string_view host) noexcept {
    const auto gap = host.find("::");
    groups before;
    groups after;
    if (!read_groups(host.substr(0, gap), before) ||
        (gap != std::string_view::npos && !read_groups(host.substr(gap + 2), after))) {
        return host_kind::none;
    }
    const auto given = before.size() + after.size();
    if (gap == std::string_view::npos ? given != 8 : given > 7) {
        return host_kind::none;
    }
    std::array<std::uint16_t, 8> address{};
    std::copy(before.begin(), before.end(), address.begin());
    std::copy(after.begin(), after.end(), address.end() - static_cast<std::ptrdiff_t>(after.size()));
    if (std::any_of(address.begin(), address.begin() + 5, [](auto group) { return group != 0; })) {
        return address[0] >= 0xFF00U ? host_kind::none : host_kind::ordinary;
    }
    if (address[5] != 0 || address[6] != 0) { // an embedded IPv4 address
        return host_kind::none;
    }
    return address[7] == 0 ? host_kind::unspecified : address[7] == 1 ? host_kind::loopback : host_kind::none;
}

host_kind kind_of(std::string_view host) noexcept {
    return host.find(':') == std::string_view::npos ? kind_of_ipv4(host) : kind_of_ipv6(host);
}

struct place {
    std::string text;
    int rank = 0;
};

int rank_of(const url& where, std::string_view heard_from) {
    const int scheme = where.scheme == "tcp" ? 0 : where.scheme == "unix" ? 1 : where.scheme == "udp" ? 2 : 3;
    return scheme * 2 + (where.host == heard_from ? 0 : 1);
}

bool is_printable(std::string_view text) noexcept {
    return std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c < '\x7F'; });
}

std::optional<url> url_of(std::string_view endpoint) {
    try {
        return is_printable(endpoint) ? std::optional{parse_url(endpoint)} : std::nullopt;
    } catch (const error&) {
        return {};
    }
}

// Replaces an unspecified address by the sender's. Fails for an IPv4 address if the sender is known by IPv6.
bool put_in_host(url& where, const observed_source& from) {
    if (kind_of(where.host) != host_kind::unspecified) {
        return true;
    }
    const bool is_ipv4 = where.host.find(':') == std::string::npos;
    if (from.host.empty() || (is_ipv4 && from.host.find(':') != std::string::npos)) {
        return false;
    }
    where.host = from.host;
    return true;
}

std::optional<place> place_of(std::string_view endpoint, const observed_source& from) {
    auto where = url_of(endpoint);
    if (!where || where->scheme == "inproc") {
        return {};
    }
    if (where->scheme == "unix") {
        return from.local ? std::optional{place{std::string{endpoint}, rank_of(*where, from.host)}} : std::nullopt;
    }
    const auto kind = kind_of(where->host);
    if (kind == host_kind::none || where->port == 0 || (kind == host_kind::loopback && !from.local) ||
        !put_in_host(*where, from)) {
        return {};
    }
    return place{to_string(*where), rank_of(*where, from.host)};
}

} // namespace

std::vector<std::string> reachable_endpoints(const std::vector<std::string>& announced, const observed_source& from) {
    std::vector<place> places;
    for (const auto& endpoint : announced) {
        if (auto found = place_of(endpoint, from)) {
            places.push_back(std::move(*found));
        }
    }
    std::stable_sort(places.begin(), places.end(), [](const place& a, const place& b) { return a.rank < b.rank; });
    std::vector<std::string> result;
    result.reserve(places.size());
    for (auto& each : places) {
        result.push_back(std::move(each.text));
    }
    return result;
}

std::vector<std::string> endpoints_to_relay(const std::vector<std::string>& announced, const observed_source& from) {
    std::vector<std::string> result;
    for (const auto& endpoint : announced) {
        auto where = url_of(endpoint);
        if (!where || where->scheme == "inproc") {
            continue;
        }
        if (from.local) { // the next reader relates it to this host, as intended
            result.push_back(endpoint);
            continue;
        }
        const auto kind = kind_of(where->host);
        if (where->scheme != "unix" && kind != host_kind::none && kind != host_kind::loopback &&
            put_in_host(*where, from)) {
            result.push_back(to_string(*where));
        }
    }
    return result;
}

namespace {

bool is_loopback(std::string_view host) noexcept { return host.starts_with("127.") || host == "::1"; }

} // namespace

observed_source observed_source::of(const identity& peer) {
    auto found = at(peer.address);
    found.local = peer.local;
    return found;
}

observed_source observed_source::at(std::string_view url) {
    try {
        const auto where = parse_url(url);
        if (where.scheme == "unix" || where.scheme == "inproc") {
            return {"127.0.0.1", true};
        }
        return {where.host, is_loopback(where.host)};
    } catch (const error&) {
        return {};
    }
}

std::string host_of(const identity& peer) {
    try {
        return parse_url(peer.address).host;
    } catch (const error&) {
        return peer.address;
    }
}

} // namespace cles::core
