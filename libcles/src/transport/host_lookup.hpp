// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/system/error_code.hpp>

#include <chrono>
#include <functional>
#include <memory>
#include <vector>

namespace cles::transport {

/// Looks up a host's addresses without waiting, on the resolver thread that Asio has for each execution context. The
/// first name that is looked up starts it; addresses never do.
class host_lookup : public std::enable_shared_from_this<host_lookup> {
  public:
    /// All addresses, in the order in which the system prefers them; none only with an error.
    using callback = std::function<void(boost::system::error_code, const std::vector<boost::asio::ip::address>&)>;

    explicit host_lookup(const boost::asio::any_io_executor& executor) : resolver_(executor), patience_(executor) {}

    /// The callback is called once, and never from inside the call: with `timed_out` after `within`, however long the
    /// system takes.
    void start(const url& where, std::chrono::milliseconds within, callback done);
    /// The callback is not called any more.
    void give_up();

  private:
    void end(boost::system::error_code code, const std::vector<boost::asio::ip::address>& found);

    boost::asio::ip::tcp::resolver resolver_; // an address is the same for TCP and UDP
    boost::asio::steady_timer patience_;
    callback done_;
};

} // namespace cles::transport
