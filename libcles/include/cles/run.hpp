// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/chrono.hpp>

#include <cstddef>

namespace boost::asio {
class io_context;
}

namespace cles {

struct run_options {
    /// How long to poll for work before sleeping; zero: not at all. Waking a core often takes longer than the rest of
    /// an exchange; polling avoids that, at the cost of processor time. Polling is suspended, except for rare attempts,
    /// while it finds no work, or while the peer needs the same core. 50 µs is a good value for request and reply on
    /// one host. More than a day counts as a day; negative values are refused.
    std::chrono::microseconds busy_poll{0};
    /// The thread's priority under SCHED_FIFO while it runs the context, 1 to 99; 0: unchanged. When it has work, such
    /// a thread preempts all others of the system except those with a higher priority (sched(7)).
    int fifo_priority = 0;
    /// Locks the present and future memory of the whole process, so that it is never paged out (mlockall(2)). It stays
    /// locked.
    bool lock_memory = false;
};

/// Runs the context in this thread until it is stopped or out of work, like its own `run`. Only for a context that one
/// thread runs; a program with its own loop polls the context there instead.
/// \return the number of handlers that ran
/// \throws cles::error with `invalid_option` if an option is out of range
/// \throws std::system_error if the system refuses the priority or the locked memory, before any handler runs
/// \throws what a handler throws; the context may be run again afterwards
std::size_t run(boost::asio::io_context& io, const run_options& options = {});

} // namespace cles
