// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "support/link_pair.hpp"

#include <string>
#include <utility>

namespace cles::test {

/// Options of a service that listens at an unused address.
inline service_options listening(std::string name, carrier kind = carrier::tcp4, const limits& bounds = {}) {
    service_options options{.name = std::move(name)};
    options.listen.push_back(fresh_address(kind));
    options.limits = bounds;
    return options;
}

/// Options of a service that does not listen, and knows one other.
inline service_options knowing(std::string name, const service& other, const limits& bounds = {}) {
    service_options options{.name = std::move(name)};
    options.peers.emplace(other.name(), other.endpoints().front());
    options.limits = bounds;
    return options;
}

} // namespace cles::test
