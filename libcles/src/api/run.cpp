// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/run.hpp>
#include <cles/wake_bound.hpp>

#include "api/spin_budget.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <system_error>

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

namespace cles {
namespace {

/// Runs the calling thread under SCHED_FIFO for its lifetime. Must be destroyed on the thread that made it.
class fifo_scheduling {
  public:
    /// \throws std::system_error if the system refuses
    explicit fifo_scheduling(int priority) {
        const auto self = ::pthread_self();
        ::pthread_getschedparam(self, &policy_before_, &parameters_before_);
        const sched_param wanted{.sched_priority = priority};
        if (const auto refused = ::pthread_setschedparam(self, SCHED_FIFO, &wanted); refused != 0) {
            throw std::system_error(refused, std::generic_category(),
                                    "SCHED_FIFO with priority " + std::to_string(priority) +
                                        " (it needs CAP_SYS_NICE or a limit of real-time priority, see ulimit -r)");
        }
    }
    fifo_scheduling(const fifo_scheduling&) = delete;
    fifo_scheduling& operator=(const fifo_scheduling&) = delete;
    ~fifo_scheduling() { ::pthread_setschedparam(::pthread_self(), policy_before_, &parameters_before_); }

  private:
    int policy_before_ = 0;
    sched_param parameters_before_{};
};

/// Locks all memory of the process, present and future. \throws std::system_error if the system refuses
void lock_memory() {
    if (::mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        throw std::system_error(errno, std::generic_category(),
                                "locking memory (it needs CAP_IPC_LOCK or a limit of locked memory, see ulimit -l)");
    }
}

// How often the kernel has preempted this thread.
long times_preempted() noexcept {
    rusage usage{};
    ::getrusage(RUSAGE_THREAD, &usage);
    return usage.ru_nivcsw;
}

// Polls for work until there is some or the time is over.
std::size_t spin(boost::asio::io_context& io, std::chrono::nanoseconds limit, core::spin_budget& budget) {
    using clock = std::chrono::steady_clock;
    if (const auto ran = io.poll(); ran != 0 || io.stopped()) {
        return ran; // it was pending
    }
    const auto preempted = times_preempted();
    const auto end = clock::now() + limit;
    do {
        if (const auto ran = io.poll(); ran != 0 || io.stopped()) {
            times_preempted() == preempted ? budget.found() : budget.missed();
            return ran;
        }
    } while (clock::now() < end);
    budget.missed();
    return 0;
}

void check(const run_options& options) {
    constexpr int max_urgent = 99; // of SCHED_FIFO, on Linux
    if (options.busy_poll.count() < 0) {
        throw error(errc::invalid_option, "run_options::busy_poll is " + std::to_string(options.busy_poll.count()) +
                                              " us: must be 0 or more");
    }
    if (options.fifo_priority < 0 || options.fifo_priority > max_urgent) {
        throw error(errc::invalid_option, "run_options::fifo_priority is " + std::to_string(options.fifo_priority) +
                                              ": must be 1 to 99, or 0 for none");
    }
}

} // namespace

std::size_t run(boost::asio::io_context& io, const run_options& options) {
    check(options);
    if (options.lock_memory) {
        lock_memory();
    }
    std::optional<fifo_scheduling> scheduling;
    if (options.fifo_priority != 0) {
        scheduling.emplace(options.fifo_priority);
    }
    if (options.busy_poll.count() == 0) {
        return io.run();
    }
    constexpr std::chrono::microseconds longest = std::chrono::hours{24};
    core::spin_budget budget{std::min(options.busy_poll, longest)};
    std::size_t total = 0;
    while (!io.stopped()) {
        const auto limit = budget.next();
        const auto found = limit.count() != 0 ? spin(io, limit, budget) : 0;
        total += found != 0 || io.stopped() ? found : io.run_one();
    }
    return total;
}

// -- the wake-up time of cores --------------------------------------------------------------------------------------

namespace {

using written_microseconds = std::int32_t; // in the host's byte order

constexpr const char* latency_limit_path = "/dev/cpu_dma_latency";

[[noreturn]] void refuse_latency_limit(int why) {
    throw std::system_error(why, std::generic_category(),
                            std::string{"limiting the wake-up time of cores (it needs write access to "} +
                                latency_limit_path + ")");
}

} // namespace

wake_bound::wake_bound(std::chrono::microseconds longest) : device_(::open(latency_limit_path, O_WRONLY | O_CLOEXEC)) {
    if (device_ < 0) {
        refuse_latency_limit(errno);
    }
    constexpr std::chrono::microseconds most{std::numeric_limits<written_microseconds>::max()};
    const auto value =
        static_cast<written_microseconds>(std::clamp(longest, std::chrono::microseconds{0}, most).count());
    if (::write(device_, &value, sizeof value) != sizeof value) {
        const auto why = errno;
        ::close(device_);
        refuse_latency_limit(why);
    }
}

wake_bound::~wake_bound() { ::close(device_); }

} // namespace cles
