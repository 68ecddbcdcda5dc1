// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include "transport/name_lookups.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/system/error_code.hpp>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace cles::transport {

class lookup_threads;

/// Looks up a host's addresses without blocking. Names are looked up side by side, each on a thread for which nobody
/// waits, because the system's resolver cannot be interrupted: a name whose server does not answer delays neither other
/// names nor the end of the program. Addresses start no thread.
///
/// Used on one executor. All lookups of an execution context share what is known of names (`name_lookups`).
class host_lookup : public std::enable_shared_from_this<host_lookup> {
  public:
    /// All addresses, in the order in which to try them; empty only with an error.
    using callback = std::function<void(boost::system::error_code, const std::vector<boost::asio::ip::address>&)>;

    /// \param threads null: those of the executor's context
    host_lookup(const boost::asio::any_io_executor& executor, url where,
                std::shared_ptr<lookup_threads> threads = nullptr);

    /// The callback is called once, and never from inside the call: with `lookup_errc::timed_out` after `within`,
    /// however long the system takes.
    void start(std::chrono::milliseconds within, callback done);
    /// The callback is not called any more.
    void give_up();
    /// This address has answered: it is the first to be tried the next time.
    void prefer(const boost::asio::ip::address& answered);

  private:
    friend class lookup_threads;

    void on_timeout(boost::system::error_code code);
    void on_outcome();
    void end(boost::system::error_code code, const std::vector<boost::asio::ip::address>& found);

    boost::asio::any_io_executor executor_;
    boost::asio::steady_timer timeout_;
    url where_;
    std::string place_; // of a name, see `name_lookups::prefer`
    callback done_;
    std::shared_ptr<lookup_threads> threads_;
    bool asked_ = false; // the threads: it is a name
    name_lookups::ticket ticket_ = 0;
    name_lookups::outcome outcome_; // written by a thread, before `on_outcome` is posted
};

} // namespace cles::transport
