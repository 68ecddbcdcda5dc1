// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string_view>

namespace jadc2 {

/// What an operator may write.
struct operator_command {
    enum class word : std::uint8_t {
        wrong,
        strike,  ///< reads an order back
        confirm, ///< gives the order that was read back
        hold,    ///< keeps that order until it is confirmed or aborted
        abort,   ///< drops that order; without one, withdraws those that have been given, until they are released
        quit,
    };

    word what = word::wrong;
    std::uint64_t target = 0; ///< of `strike`: the number of its track
    bool again = false;       ///< of `strike`: even if the target has been attacked
};

operator_command parse_command(std::string_view line);

} // namespace jadc2
