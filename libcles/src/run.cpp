// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/run.hpp>

#include "asio/real_time.hpp"
#include "core/spin_budget.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>

#include <sys/resource.h>

namespace cles {
namespace {

// How often the kernel took the core from this thread for another one.
long times_preempted() noexcept {
    rusage usage{};
    ::getrusage(RUSAGE_THREAD, &usage);
    return usage.ru_nivcsw;
}

// Looks for work until there is some or the time is over.
std::size_t spin(boost::asio::io_context& io, std::chrono::nanoseconds limit, core::spin_budget& budget) {
    using clock = std::chrono::steady_clock;
    if (const auto ran = io.poll(); ran != 0 || io.stopped()) {
        return ran; // it was there already
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
    constexpr int most_urgent = 99; // of SCHED_FIFO, on Linux
    if (options.busy_poll.count() < 0) {
        throw error(errc::invalid_option,
                    "run_options::busy_poll is " + std::to_string(options.busy_poll.count()) + " us: a time from 0");
    }
    if (options.fifo_priority < 0 || options.fifo_priority > most_urgent) {
        throw error(errc::invalid_option, "run_options::fifo_priority is " + std::to_string(options.fifo_priority) +
                                              ": 1 to 99, or 0 for none");
    }
}

} // namespace

std::size_t run(boost::asio::io_context& io, const run_options& options) {
    check(options);
    if (options.lock_memory) {
        asio_port::lock_memory();
    }
    std::optional<asio_port::fifo_scheduling> scheduling;
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

} // namespace cles
