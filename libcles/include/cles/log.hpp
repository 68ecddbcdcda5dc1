// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>

namespace cles {

enum class log_level : std::uint8_t { debug, info, warning, error };

/// Where a service tells what happens to it. Called on the service's executor, the text being valid for the call; it
/// must neither throw nor block. The library links no logging framework: a program hands its own in.
using log_sink = std::function<void(log_level, std::string_view)>;

} // namespace cles
