// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <exception>

namespace examples {

/// To be given to `co_spawn`: what the coroutine throws then comes out of `io_context::run`, instead of going unseen.
inline constexpr auto rethrow = [](const std::exception_ptr& failure) {
    if (failure) {
        std::rethrow_exception(failure);
    }
};

} // namespace examples
