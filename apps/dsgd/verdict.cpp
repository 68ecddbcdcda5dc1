// SPDX-License-Identifier: BSL-1.0
#include "verdict.hpp"

#include <array>
#include <cstdio>

namespace dsgd {

std::string shortcoming(const sgd::quality& found) {
    if (found.mse <= found.least_mse * (1 + tolerated)) {
        return {};
    }
    constexpr double of_a_constant = 0.25; // the classes are as large as each other
    std::array<char, 64> ratio{};
    std::snprintf(ratio.data(), ratio.size(), "%.4g", found.mse / found.least_mse);
    return std::string{"the result is not good: its error is "} + ratio.data() + " times the best possible" +
           (found.mse >= of_a_constant ? ", and a constant does better" : "") +
           ". The descent has not converged: it needs more epochs, fewer shards or another rate";
}

} // namespace dsgd
