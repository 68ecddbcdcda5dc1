// SPDX-License-Identifier: BSL-1.0
#include "core/teller.hpp"

#include <cles/error.hpp>
#include <cles/url.hpp>

namespace cles::core {
namespace {

bool is_loopback(std::string_view host) noexcept { return host.starts_with("127.") || host == "::1"; }

} // namespace

teller teller::of(const identity& peer) {
    auto found = at(peer.address);
    found.local = peer.local;
    return found;
}

teller teller::at(std::string_view url) {
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
