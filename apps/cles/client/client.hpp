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
#include <optional>
#include <string>
#include <string_view>

namespace tool {

/// The command as a node that only asks. It runs one coroutine, and ends it early on a signal, when its time is up, or
/// when nobody reads its output any more; a request in flight is then withdrawn.
class client {
  public:
    /// `in_group`: it takes part in multicast, even where nothing is to be found by its name.
    client(const address_book& addresses, int verbosity, bool in_group = false);

    cles::service& node() noexcept { return node_; }
    boost::asio::io_context& context() noexcept { return io_; }

    /// Where and for how long to ask for this noun; no limit: the protocol's default.
    [[nodiscard]] cles::call_options options_for(std::string_view noun,
                                                 std::optional<std::chrono::milliseconds> limit) const;

    /// The URL at which that node is asked, once it has answered.
    [[nodiscard]] std::string where_is(std::string_view node) const;

    /// Where a request for this noun fails because there is no such task, the node is asked what it offers, so that the
    /// task that was probably meant can be named.
    void explain_failures_of(std::string_view noun) { noun_ = noun; }

    /// Ends the work, with this exit code.
    void end(int code) { end_early(code); }
    /// Ends the work, with success, when so much time has gone.
    void end_after(std::chrono::milliseconds span);

    /// Waits; for a coroutine of this client.
    boost::asio::awaitable<void> sleep_until(std::chrono::steady_clock::time_point when);

    /// Runs the coroutine and gives the exit code; what it throws is reported.
    int run(boost::asio::awaitable<void> work);

  private:
    boost::asio::awaitable<void> run_explained(boost::asio::awaitable<void> work);
    boost::asio::awaitable<void> look_for_task();
    void look_for_node();
    void end_early(int code);
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
    std::string hint_; ///< what was probably meant
    std::optional<int> early_;
    bool finished_ = false; // what has expired or come in by then cannot be cancelled any more
};

} // namespace tool
