// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <pthread.h>

namespace cles::runtime {

/// A mutex that is held for some tens of nanoseconds: who finds it taken looks again a few times before going to sleep,
/// which would take a hundred times longer than what it waits for.
class brief_mutex {
  public:
    brief_mutex() noexcept {
        pthread_mutexattr_t how;
        ::pthread_mutexattr_init(&how);
#ifdef PTHREAD_ADAPTIVE_MUTEX_INITIALIZER_NP
        ::pthread_mutexattr_settype(&how, PTHREAD_MUTEX_ADAPTIVE_NP);
#endif
        ::pthread_mutex_init(&mutex_, &how);
        ::pthread_mutexattr_destroy(&how);
    }
    brief_mutex(const brief_mutex&) = delete;
    brief_mutex& operator=(const brief_mutex&) = delete;
    ~brief_mutex() { ::pthread_mutex_destroy(&mutex_); }

    void lock() noexcept { ::pthread_mutex_lock(&mutex_); }
    void unlock() noexcept { ::pthread_mutex_unlock(&mutex_); }

  private:
    pthread_mutex_t mutex_{};
};

} // namespace cles::runtime
