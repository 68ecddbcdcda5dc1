// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include <memory>

namespace cles::transport {

/// `unix:///path` (a socket file, for its owner alone; one that nobody listens at any more is replaced) and
/// `unix://@name` (abstract). The peer's user id is known from the kernel.
std::unique_ptr<link_transport> make_unix();

} // namespace cles::transport
