// SPDX-License-Identifier: BSL-1.0
#include "fixed_number.hpp"

#include <array>
#include <cstdio>

namespace jadc2 {

std::string fixed(double number, int digits) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "%.*f", digits, number);
    return text.data();
}

} // namespace jadc2
