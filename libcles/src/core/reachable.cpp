// SPDX-License-Identifier: BSL-1.0
#include "core/reachable.hpp"

#include <cles/error.hpp>
#include <cles/url.hpp>

#include "protocol/digit.hpp"

#include <boost/container/static_vector.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace cles::core {
namespace {

/// An IP address as far as it matters here.
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
        while (digits < host.size() && digits < 4 && protocol::is_digit(host[digits])) {
            value = value * 10 + static_cast<std::uint32_t>(host[digits++] - '0');
        }
        if (digits == 0 || value > 255 || (digits > 1 && host.front() == '0')) {
            return host_kind::none;
        }
        host.remove_prefix(digits);
        address = address << 8U | value;
    }
    if (!host.empty() || address >= 0xE0000000U) { // groups, and what is for all, are nobody's
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
    if (address[5] != 0 || address[6] != 0) { // an IPv4 address in disguise
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

std::optional<place> place_of(std::string_view endpoint, const group_source& from, const std::string& heard_from) {
    url where;
    try {
        where = parse_url(endpoint);
    } catch (const error&) {
        return {};
    }
    const bool printable = std::all_of(endpoint.begin(), endpoint.end(), [](char c) { return c > ' ' && c < '\x7F'; });
    if (where.scheme == "inproc" || !printable) {
        return {};
    }
    if (where.scheme == "unix") {
        return from.is_loopback() ? std::optional{place{std::string{endpoint}, rank_of(where, heard_from)}}
                                  : std::nullopt;
    }
    const auto kind = kind_of(where.host);
    if (kind == host_kind::none || where.port == 0 || (kind == host_kind::loopback && !from.is_loopback())) {
        return {};
    }
    if (kind == host_kind::unspecified) {
        where.host = heard_from;
    }
    return place{to_string(where), rank_of(where, heard_from)};
}

} // namespace

std::vector<std::string> reachable_endpoints(const std::vector<std::string>& announced, const group_source& from) {
    const auto heard_from = host_text(from);
    std::vector<place> places;
    for (const auto& endpoint : announced) {
        if (auto found = place_of(endpoint, from, heard_from)) {
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

} // namespace cles::core
