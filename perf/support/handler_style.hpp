// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>

namespace cles::perf {

/// How results reach the caller's code.
enum class handler_style : std::uint8_t {
    coroutine, ///< `co_await`, as in the examples
    callback,  ///< a function object, without a coroutine around it
    batch,     ///< of feeds: a function object that gets all events of a read
};

} // namespace cles::perf
