// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/line_link.hpp>

#include "transport/address_race.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/system/error_code.hpp>

#include <cstddef>
#include <functional>
#include <memory>

namespace cles::transport {

/// Tries the addresses of a host until one has answered or all have failed (`address_race`), within `limits::connect`
/// in all since this was created. What it is to try one, and when it has answered, is up to the derived class.
class address_dialler : public std::enable_shared_from_this<address_dialler> {
  public:
    address_dialler(const address_dialler&) = delete;
    address_dialler& operator=(const address_dialler&) = delete;

    /// Ends without a link.
    void fail(boost::system::error_code why);
    /// As above, without the callback.
    void give_up();

  protected:
    /// \param late the error when the time is over
    address_dialler(const boost::asio::any_io_executor& executor, const limits& bounds, boost::system::error_code late,
                    dial_callback done);
    ~address_dialler() = default;

    [[nodiscard]] boost::asio::any_io_executor executor() { return timeout_.get_executor(); }

    /// Tries the first of so many. `answered` is called with the number of the one that has answered, just before the
    /// callback.
    void begin_race(std::size_t count, std::function<void(std::size_t)> answered);
    /// Tries those whose turn it is.
    void continue_race();
    /// That one has answered. \pre it is not among the attempts that `close_attempts` closes
    void win(std::size_t which, link_ptr made);
    /// One that was tried has failed. Fails for this reason if it is the last.
    void note_failure(boost::system::error_code why);
    /// One that was tried has accepted the connection, and has still to prove who it is.
    void note_acceptance();

  private:
    /// Tries that one. May call `note_failure`.
    virtual void begin(std::size_t which) = 0;
    /// Asks those again that are being tried, if it is time. Returns when it is time next.
    virtual time_point ask_again(time_point) { return time_point::max(); }
    /// Those that are still being tried.
    virtual void close_attempts() = 0;

    void on_timeout(boost::system::error_code code);
    void on_due(boost::system::error_code code);

    boost::asio::steady_timer timeout_;
    boost::asio::steady_timer next_; // until the next one is tried
    boost::system::error_code late_;
    dial_callback done_; // null: it has ended
    std::function<void(std::size_t)> answered_;
    address_race race_{0};
};

} // namespace cles::transport
