// SPDX-License-Identifier: BSL-1.0
#include "isolation/plugin_environment.hpp"

#include <algorithm>
#include <array>
#include <string_view>

#include <unistd.h>

namespace cles::runtime {
namespace {

bool is_passed(std::string_view name) {
    constexpr std::array<std::string_view, 6> names{"HOME", "LANG", "LANGUAGE", "PATH", "TMPDIR", "TZ"};
    return std::ranges::find(names, name) != names.end() || name.starts_with("LC_") || name.starts_with("LD_") ||
           name.starts_with("MALLOC_") || name.ends_with("SAN_OPTIONS"); // of sanitizers
}

} // namespace

std::vector<char*> plugin_environment() {
    std::vector<char*> passed;
    for (auto** each = environ; *each != nullptr; ++each) {
        const std::string_view variable{*each};
        if (is_passed(variable.substr(0, variable.find('=')))) {
            passed.push_back(*each);
        }
    }
    passed.push_back(nullptr);
    return passed;
}

} // namespace cles::runtime
