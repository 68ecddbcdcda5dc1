// SPDX-License-Identifier: BSL-1.0
#include "check_arguments.hpp"

#include <cles/error.hpp>
#include <cles/url.hpp>

#include <CLI/CLI.hpp>

namespace dsgd {

std::string wrong_url(const std::string& text) {
    try {
        cles::parse_url(text);
        return {};
    } catch (const cles::error& e) {
        return e.message();
    }
}

std::string wrong_rate(const std::string& text) {
    double rate = 0;
    const bool fits = CLI::detail::lexical_cast(text, rate) && rate >= 1e-12 && rate <= 1000; // false for NaN, too
    return fits ? "" : "a number from 1e-12 to 1000";
}

} // namespace dsgd
