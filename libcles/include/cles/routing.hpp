// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles {

namespace detail {
struct routing_part;
} // namespace detail

/// What makes a service act for its clients on `any:`, `all:` and the names of other nodes (docs/routing.md), to be
/// handed to `service_options::routing`. A part of its own, so that a program which does not name it does not carry it.
const detail::routing_part* routing() noexcept;

} // namespace cles
