// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <charconv>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

namespace cles::perf {

/// The value of a command line option: a number from 1 to `most`. \throws std::invalid_argument that says so
template <class Number>
Number number(std::string_view option, std::string_view text, Number most) {
    Number value{};
    const auto [end, wrong] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (wrong != std::errc{} || end != text.data() + text.size() || value < 1 || value > most) {
        throw std::invalid_argument(std::string{option} + " takes a number from 1 to " +
                                    std::to_string(static_cast<unsigned>(most)));
    }
    return value;
}

} // namespace cles::perf
