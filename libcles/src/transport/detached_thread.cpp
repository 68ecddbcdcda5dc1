// SPDX-License-Identifier: BSL-1.0
#include "transport/detached_thread.hpp"

#include <csignal>
#include <cstddef>
#include <memory>
#include <utility>

#include <pthread.h>

namespace cles::transport {
namespace {

// Far more than the system's resolver needs, and far less than the default: a program that locks its memory locks the
// stacks of all threads, whether they are used or not.
constexpr std::size_t stack_bytes = std::size_t{1} << 19U;

void* run(void* raw) {
    const std::unique_ptr<std::function<void()>> function{static_cast<std::function<void()>*>(raw)};
    (*function)();
    return nullptr;
}

} // namespace

// Not std::thread, which has no options, and throws. A thread inherits which signals are blocked.
boost::system::error_code start_detached(std::function<void()> function) {
    auto owned = std::make_unique<std::function<void()>>(std::move(function));
    pthread_attr_t how;
    ::pthread_attr_init(&how);
    ::pthread_attr_setdetachstate(&how, PTHREAD_CREATE_DETACHED);
    ::pthread_attr_setstacksize(&how, stack_bytes);
    ::pthread_attr_setinheritsched(&how, PTHREAD_EXPLICIT_SCHED); // not urgent, whatever the calling thread is
    sigset_t all;
    sigset_t before;
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before);
    pthread_t made{};
    const int failed = ::pthread_create(&made, &how, run, owned.get());
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
    ::pthread_attr_destroy(&how);
    if (failed == 0) {
        static_cast<void>(owned.release()); // the thread owns it
    }
    return {failed, boost::system::system_category()};
}

} // namespace cles::transport
