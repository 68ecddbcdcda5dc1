// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/limit_ranges.hpp>

#include <string>

namespace cles {
namespace {

template <class T>
void refuse_outside(std::string_view name, T value, T least, T most, const char* unit) {
    if (value < least || value > most) {
        throw error(errc::invalid_option, "limits." + std::string{name} + " is " + std::to_string(value) + unit +
                                              ": must be " + std::to_string(least) + " to " + std::to_string(most) +
                                              unit);
    }
}

} // namespace

void check(const limits& bounds) {
    for (const auto& range : count_ranges) {
        refuse_outside(range.name, bounds.*range.member, range.least, range.most, "");
    }
    for (const auto& range : time_ranges) {
        refuse_outside(range.name, (bounds.*range.member).count(), range.least.count(), range.most.count(), " ms");
    }
}

} // namespace cles
