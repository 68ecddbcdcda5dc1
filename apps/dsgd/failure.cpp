// SPDX-License-Identifier: BSL-1.0
#include "failure.hpp"

#include "dsgd/verdict.hpp"

#include <cstdio>

namespace dsgd {

int report_failure(const cles::error& why) {
    const auto code = why.code();
    std::fprintf(stderr, "cles-dsgd: %s\n", why.message().c_str());
    const bool missing = code == cles::errc::no_target || code == cles::errc::no_task;
    return missing ? 3 : code == cles::errc::deadline ? 4 : code == cles::errc::busy ? 6 : 5;
}

int report_shortcoming(const std::string& text) {
    if (text.empty()) {
        return 0;
    }
    std::fprintf(stderr, "cles-dsgd: %s\n", text.c_str());
    return not_good;
}

} // namespace dsgd
