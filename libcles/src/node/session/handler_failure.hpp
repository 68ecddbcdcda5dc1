// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/reply_line.hpp"

#include <exception>

namespace cles::core {

/// The failure that a requester receives for a handler's exception: a `cles::error` keeps its code and message,
/// anything else is `failed`. File paths are removed, so that they do not leak.
protocol::failure describe(const std::exception_ptr& thrown);

} // namespace cles::core
