// SPDX-License-Identifier: BSL-1.0
#include "node/membership/reachable_endpoints.hpp"

#include <cles/error.hpp>
#include <cles/url.hpp>

#include "port/ip_network.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>

namespace cles::core {
namespace {

/// The kinds of IP addresses that are treated differently.
enum class host_kind { none, ordinary, unspecified, loopback, link_local };

// A scope, or an IPv4 address written within an IPv6 address, means nothing to other hosts.
host_kind kind_of(std::string_view host) noexcept {
    const auto address = parse_ip_address(host);
    if (!address || (address->is_v6 && host.find_first_of("%.") != std::string_view::npos)) {
        return host_kind::none;
    }
    const auto& bytes = address->bytes;
    const auto is_zero = [&bytes](std::size_t from, std::size_t to) {
        return std::all_of(bytes.begin() + from, bytes.begin() + to, [](auto byte) { return byte == 0; });
    };
    if (is_zero(0, bytes.size())) {
        return host_kind::unspecified;
    }
    if (!address->is_v6) { // from 224 on: multicast, reserved and broadcast addresses
        return bytes[0] == 127 ? host_kind::loopback : bytes[0] < 224 ? host_kind::ordinary : host_kind::none;
    }
    if (!is_zero(0, 10)) {
        const bool is_link_local = bytes[0] == 0xFE && (bytes[1] & 0xC0U) == 0x80;
        return bytes[0] == 0xFF ? host_kind::none : is_link_local ? host_kind::link_local : host_kind::ordinary;
    }
    return is_zero(10, 15) && bytes[15] == 1 ? host_kind::loopback : host_kind::none; // else an embedded IPv4 address
}

constexpr std::string_view zone_mark = "%25"; // in a URL

// "eth0" of "fe80::1%eth0"; empty if there is none.
std::string_view zone_of(std::string_view host) noexcept {
    const auto at = host.find('%');
    return at == std::string_view::npos ? std::string_view{} : host.substr(at + 1);
}

struct place {
    std::string text;
    int rank = 0;
};

int rank_of(const url& where, std::string_view received_from) {
    const int scheme = where.scheme == "tls" || where.scheme == "tcp" ? 0
                       : stays_on_host(where.scheme)                  ? 1
                       : where.scheme == "udp"                        ? 2
                                                                      : 3;
    return scheme * 2 + (where.host == received_from ? 0 : 1);
}

std::optional<url> url_of(std::string_view text) {
    try {
        return parse_url(text);
    } catch (const error&) {
        return {};
    }
}

bool is_printable(std::string_view text) noexcept {
    return std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c < '\x7F'; });
}

// An announced endpoint; nothing if no other node can use it.
std::optional<url> usable_url(std::string_view endpoint) {
    auto where = is_printable(endpoint) ? url_of(endpoint) : std::nullopt;
    return where && where->scheme != "inproc" ? std::move(where) : std::nullopt;
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

// A link-local address of another host is one of the link by which the sender is reached. Fails if that is unknown.
bool put_on_link(url& where, const observed_source& from) {
    if (kind_of(where.host) != host_kind::link_local) {
        return true;
    }
    const auto zone = zone_of(from.host);
    if (!zone.empty()) {
        where.host.append("%").append(zone);
    }
    return !zone.empty();
}

std::optional<place> place_of(std::string_view endpoint, const observed_source& from) {
    auto where = usable_url(endpoint);
    if (!where) {
        return {};
    }
    if (stays_on_host(where->scheme)) {
        return from.local ? std::optional{place{std::string{endpoint}, rank_of(*where, from.host)}} : std::nullopt;
    }
    const auto kind = kind_of(where->host);
    if (kind == host_kind::none || where->port == 0 || (kind == host_kind::loopback && !from.local) ||
        !put_in_host(*where, from) || !put_on_link(*where, from)) {
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
        auto where = usable_url(endpoint);
        if (!where) {
            continue;
        }
        if (from.local) { // the next reader relates it to this host, as intended
            result.push_back(endpoint);
            continue;
        }
        const auto kind = kind_of(where->host);
        if (!stays_on_host(where->scheme) && kind != host_kind::none && kind != host_kind::loopback &&
            put_in_host(*where, from) && put_on_link(*where, from)) {
            result.push_back(to_string(*where));
        }
    }
    return result;
}

std::vector<std::string> endpoints_on_link(const std::vector<std::string>& relayed, std::string_view zone) {
    std::vector<std::string> result;
    for (const auto& each : relayed) {
        const auto begin = each.find(zone_mark);
        const auto end = begin == std::string::npos ? begin : each.find(']', begin);
        if (end == std::string::npos) { // it has none; the path of a Unix socket may look alike
            result.push_back(each);
            continue;
        }
        const auto name = begin + zone_mark.size();
        if (!zone.empty() && std::string_view{each}.substr(name, end - name) == zone) {
            result.push_back(std::string{each}.erase(begin, end - begin));
        }
    }
    return result;
}

std::string observed_source::zone() const { return std::string{zone_of(host)}; }

observed_source observed_source::of(const identity& peer) {
    auto found = at(peer.address);
    found.local = peer.local;
    found.name = peer.name;
    return found;
}

observed_source observed_source::at(std::string_view url) {
    const auto where = url_of(url);
    if (!where) {
        return {};
    }
    if (stays_on_host(where->scheme)) {
        return {"127.0.0.1", true};
    }
    return {where->host, where->host.starts_with("127.") || where->host == "::1"};
}

std::string host_of(const identity& peer) {
    const auto where = url_of(peer.address);
    return where ? where->host : peer.address;
}

std::string holder_of(const identity& peer) {
    if (peer.uid) {
        return "user " + std::to_string(*peer.uid);
    }
    const auto host = host_of(peer);
    return host.empty() ? peer.transport : share_of_address(host);
}

} // namespace cles::core
