// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <cstddef>

namespace boost::asio {
class io_context;
}

namespace cles {

struct run_options {
    /// How long to look for work before going to sleep; zero: not at all. A core that does not sleep need not be woken,
    /// which on most machines takes longer than all the rest of an exchange. It is bought with processor time, and is
    /// given up, but for a rare try, while it finds nothing or keeps the peer from the core that both run on. 50 µs is
    /// a good bound for request and reply on one host. More than a day counts as a day; less than 0 is refused.
    std::chrono::microseconds busy_poll{0};
    /// The thread's priority under SCHED_FIFO while it runs the context, 1 to 99; 0: as it is. Such a thread takes the
    /// core from all others of the system but for those of a higher priority, as soon as there is work (sched(7)).
    int fifo_priority = 0;
    /// Locks the memory of the whole process, present and future, so that none of it has to be fetched (mlockall(2)).
    /// It stays locked.
    bool lock_memory = false;
};

/// Runs the context in this thread until it is stopped or out of work, as its own `run` does. For a context that one
/// thread runs; a program with a loop of its own polls the context there instead.
/// \return how many handlers ran
/// \throws cles::error with `invalid_option` where an option is outside of what it may be
/// \throws std::system_error where the system refuses the priority or the locked memory, before anything runs
/// \throws what a handler throws; the context may be run again afterwards
std::size_t run(boost::asio::io_context& io, const run_options& options = {});

} // namespace cles
