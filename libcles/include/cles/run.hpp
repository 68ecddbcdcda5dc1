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
    /// a good bound for request and reply on one host.
    std::chrono::microseconds busy_poll{0};
};

/// Runs the context in this thread until it is stopped or out of work, as its own `run` does. For a context that one
/// thread runs; a program with a loop of its own polls the context there instead.
/// \return how many handlers ran
/// \throws what a handler throws; the context may be run again afterwards
std::size_t run(boost::asio::io_context& io, const run_options& options = {});

} // namespace cles
