// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles {

namespace detail {
struct tracing_part;
} // namespace detail

/// Returns a value for `service_options::tracing` that makes the service record how long the traced requests that it
/// receives and sends take, for `cles trace` (docs/protocol.md, "Traces"). Only programs that call this function link
/// its code.
const detail::tracing_part* tracing() noexcept;

} // namespace cles
