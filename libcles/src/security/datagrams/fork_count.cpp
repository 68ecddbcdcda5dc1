// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/fork_count.hpp"

#include <atomic>
#include <new>

#include <pthread.h>

namespace cles::security {
namespace {

std::atomic<std::uint32_t> forks{0};

} // namespace

std::uint32_t fork_count() {
    static const bool counted =
        ::pthread_atfork(nullptr, nullptr, [] { forks.fetch_add(1, std::memory_order_relaxed); }) == 0;
    if (!counted) {
        throw std::bad_alloc{};
    }
    return forks.load(std::memory_order_relaxed);
}

} // namespace cles::security
