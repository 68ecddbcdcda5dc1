// SPDX-License-Identifier: BSL-1.0
#include "asio/real_time.hpp"

#include <cerrno>
#include <string>
#include <system_error>

#include <pthread.h>
#include <sys/mman.h>

namespace cles::asio_port {

fifo_scheduling::fifo_scheduling(int priority) {
    const auto self = ::pthread_self();
    ::pthread_getschedparam(self, &policy_before_, &parameters_before_);
    const sched_param wanted{.sched_priority = priority};
    if (const auto refused = ::pthread_setschedparam(self, SCHED_FIFO, &wanted); refused != 0) {
        throw std::system_error(refused, std::generic_category(),
                                "SCHED_FIFO with priority " + std::to_string(priority) +
                                    " (it needs CAP_SYS_NICE or a limit of real-time priority, see ulimit -r)");
    }
}

fifo_scheduling::~fifo_scheduling() { ::pthread_setschedparam(::pthread_self(), policy_before_, &parameters_before_); }

void lock_memory() {
    if (::mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        throw std::system_error(errno, std::generic_category(),
                                "locking memory (it needs CAP_IPC_LOCK or a limit of locked memory, see ulimit -l)");
    }
}

} // namespace cles::asio_port
