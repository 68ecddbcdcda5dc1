// SPDX-License-Identifier: BSL-1.0
#include "trust/no_core_dumps.hpp"

#include <cerrno>
#include <system_error>

#include <sys/prctl.h>

namespace tool {
namespace {

void require(int result) {
    if (result < 0) {
        throw std::system_error{errno, std::generic_category(), "cannot turn off core dumps"};
    }
}

} // namespace

no_core_dumps::no_core_dumps() {
    dumpable_ = ::prctl(PR_GET_DUMPABLE);
    require(dumpable_);
    require(::getrlimit(RLIMIT_CORE, &limit_));
    const rlimit none{0, limit_.rlim_max}; // a core pattern that is a pipe ignores the limit, but not the other
    require(::setrlimit(RLIMIT_CORE, &none));
    require(::prctl(PR_SET_DUMPABLE, 0));
}

no_core_dumps::~no_core_dumps() {
    ::prctl(PR_SET_DUMPABLE, dumpable_);
    ::setrlimit(RLIMIT_CORE, &limit_);
}

} // namespace tool
