// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <chrono>
#include <source_location>
#include <string>

namespace cles::test {

/// Long enough for a sanitizer build on a busy machine; no test that passes waits for it.
inline constexpr std::chrono::seconds patience{20};

[[noreturn]] inline void waited_in_vain(const std::source_location& where) {
    BOOST_FAIL("waited in vain at line " + std::to_string(where.line()) + " of " + where.file_name());
    throw std::logic_error{"not reached"};
}

/// Runs the context until the condition holds, which is checked after every handler and every millisecond. The test
/// fails if it does not hold within `limit`.
template <class Condition>
void run_until(boost::asio::io_context& io, Condition&& holds, std::chrono::milliseconds limit = patience,
               const std::source_location& where = std::source_location::current()) {
    const auto busy = boost::asio::make_work_guard(io);
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!holds()) {
        if (std::chrono::steady_clock::now() > end) {
            waited_in_vain(where);
        }
        if (io.stopped()) {
            io.restart();
        }
        io.run_one_for(std::chrono::milliseconds{1});
    }
}

/// Runs everything that is ready, and what that makes ready: for tests that something does not happen.
inline void run_ready(boost::asio::io_context& io) {
    const auto busy = boost::asio::make_work_guard(io);
    for (int quiet = 0; quiet < 5;) {
        if (io.stopped()) {
            io.restart();
        }
        quiet = io.run_one_for(std::chrono::milliseconds{2}) == 0 ? quiet + 1 : 0;
    }
}

} // namespace cles::test
