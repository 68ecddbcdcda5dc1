// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/service.hpp>

#include "options/addresses.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <exception>
#include <optional>
#include <string>
#include <string_view>

namespace tool {

/// The command as a node that only sends requests. It runs one coroutine, and cancels it on a signal, at the end of a
/// time limit, or when the reader of its output is gone; a request in flight is then cancelled at its node.
class client {
  public:
    /// `in_group`: it takes part in multicast even if no node has to be found by its name.
    client(const address_book& addresses, int verbosity, bool in_group = false);

    cles::service& node() noexcept { return node_; }
    boost::asio::io_context& context() noexcept { return io_; }

    /// The address and the deadline of requests with this noun; without a limit, the protocol's default.
    [[nodiscard]] cles::call_options options_for(std::string_view noun,
                                                 std::optional<std::chrono::milliseconds> limit) const;

    /// The pool of this command; empty: the unnamed pool.
    [[nodiscard]] std::string pool() const { return addresses_.pool(); }

    /// The URL of that node, which is known at the latest when it has answered.
    [[nodiscard]] std::string endpoint_of(std::string_view node) const;

    /// If a request with this noun fails because the node or the task does not exist, a similar name is suggested; for
    /// a task, the node is asked what it offers.
    void explain_failures_of(std::string_view noun) { noun_ = noun; }

    /// Cancels the coroutine; `run` returns this exit code.
    void end(int code);
    [[nodiscard]] bool is_ending() const noexcept { return end_code_.has_value(); }
    /// Ends with success after that time.
    void end_after(std::chrono::milliseconds limit);

    /// Waits; for a coroutine of this client.
    boost::asio::awaitable<void> sleep_until(std::chrono::steady_clock::time_point when);

    /// Runs the coroutine, and reports what it throws. \return the exit code
    int run(boost::asio::awaitable<void> work);

  private:
    boost::asio::awaitable<void> run_explained(boost::asio::awaitable<void> work);
    boost::asio::awaitable<void> suggest_task();
    void suggest_node();
    void suggest_address();
    [[nodiscard]] bool may_have_asked_secured_node(const std::exception_ptr& thrown) const;
    void wait_for_signal();
    void watch_output();

    const address_book& addresses_;
    boost::asio::io_context io_{1};
    boost::asio::signal_set signals_;
    boost::asio::steady_timer end_timer_;
    boost::asio::steady_timer output_timer_;
    boost::asio::steady_timer sleep_timer_;
    boost::asio::cancellation_signal cancel_;
    cles::service node_;
    std::string noun_;
    std::string hint_;
    std::optional<int> end_code_; ///< set when the coroutine is cancelled
    bool finished_ = false;       // handlers that were queued by then can no longer be cancelled
};

} // namespace tool
