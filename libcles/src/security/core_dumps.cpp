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
    limit.rlim_cur = 0; // a core pattern that is a pipe ignores the limit, but not the other
    require(::setrlimit(RLIMIT_CORE, &limit));
    require(::prctl(PR_SET_DUMPABLE, 0));
}

} // namespace cles::security
