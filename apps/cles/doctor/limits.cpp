// SPDX-License-Identifier: BSL-1.0
#include <cles/limits.hpp>

#include "doctor/checks.hpp"

#include <string>

#include <sys/resource.h>

namespace tool {

void check_limits(findings& found) {
    constexpr rlim_t for_the_rest = 64; // listeners, files, libraries
    rlimit files{};
    if (::getrlimit(RLIMIT_NOFILE, &files) != 0) {
        return;
    }
    const rlim_t wanted = cles::limits{}.links + for_the_rest;
    const auto text = "a program may have " +
                      (files.rlim_cur == RLIM_INFINITY ? "any number of" : std::to_string(files.rlim_cur)) +
                      " files open";
    if (files.rlim_cur < wanted) {
        found.push_back({"limits", verdict::warning, text + ", fewer than the links of a node",
                         "ulimit -n " + std::to_string(wanted) +
                             ", or LimitNOFILE= in the unit file, where as many "
                             "clients are expected"});
    } else {
        found.push_back({"limits", verdict::ok, text});
    }
}

} // namespace tool
