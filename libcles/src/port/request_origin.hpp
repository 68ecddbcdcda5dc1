// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>

namespace cles::core {

/// Whose a request is, in a secured fleet (docs/protocol_security.md, "Forwarded requests"). Without security, both are
/// empty.
struct request_origin {
    std::string_view requester{}; ///< the member whose rights apply; empty: nobody, who may do nothing
    std::string_view forwarder{}; ///< the member that has sent it in the requester's name; empty: the requester itself
};

/// A copy, for what outlives the request's line.
struct owned_origin {
    std::string requester{};
    std::string forwarder{};

    owned_origin() = default;
    // NOLINTNEXTLINE(google-explicit-constructor): a copy of the same
    owned_origin(const request_origin& of) : requester(of.requester), forwarder(of.forwarder) {}
    // NOLINTNEXTLINE(google-explicit-constructor)
    operator request_origin() const noexcept { return {.requester = requester, .forwarder = forwarder}; }
    // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 takes the resulting zero for a pointer
    auto operator<=>(const owned_origin&) const = default;
};

} // namespace cles::core
