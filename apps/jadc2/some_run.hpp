// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <random>
#include <string>

namespace jadc2 {

/// No other run has the same, so that what is named after it is no other run's.
inline std::string some_run() {
    std::random_device chance;
    return std::to_string(chance());
}

} // namespace jadc2
