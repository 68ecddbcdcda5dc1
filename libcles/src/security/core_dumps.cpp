// SPDX-License-Identifier: BSL-1.0
#include <cles/security/core_dumps.hpp>

#include <cerrno>
#include <system_error>

#include <sys/prctl.h>
#include <sys/resource.h>

namespace cles::security {
namespace {

void require(int result) {
    if (result < 0) {
        throw std::system_error{errno, std::generic_category(), "cannot turn off core dumps"};
    }
}

} // namespace

void forbid_core_dumps() {
    rlimit limit{};
    require(::getrlimit(RLIMIT_CORE, &limit));
    limit.rlim_cur = 0;
    require(::setrlimit(RLIMIT_CORE, &limit));
    // The kernel ignores this limit if the core pattern is a pipe, so the process is also made undumpable.
    require(::prctl(PR_SET_DUMPABLE, 0));
}

} // namespace cles::security
