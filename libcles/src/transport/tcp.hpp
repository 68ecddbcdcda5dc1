// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include <memory>

namespace cles::transport {

/// `tcp://host:port`. Nagle's algorithm is off, keep-alive on. A host name is looked up where it is used, by a call
/// that may block: give addresses where that matters.
std::unique_ptr<link_transport> make_tcp();

} // namespace cles::transport
