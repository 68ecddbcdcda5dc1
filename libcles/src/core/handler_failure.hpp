// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/message.hpp"

#include <exception>

namespace cles::core {

/// What a handler's exception says to the requester: a `cles::error` its code and words, anything else `failed`. File
/// paths are taken out of the words, since they are nobody else's business.
protocol::failure describe(const std::exception_ptr& thrown);

} // namespace cles::core
