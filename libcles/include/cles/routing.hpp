// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles {

namespace detail {
struct routing_part;
} // namespace detail

/// Returns a value for `service_options::routing` that makes the service forward requests of its clients to `any:`,
/// `all:` and other nodes (docs/routing.md). Only programs that call this function link its code.
const detail::routing_part* routing() noexcept;

} // namespace cles
