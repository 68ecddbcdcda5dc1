// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/system/error_code.hpp>

#include <functional>
#include <memory>

namespace cles::transport {

/// Notices that interfaces of this host, or their IPv4 addresses, may have changed: the system reports it to a socket
/// of rtnetlink(7). If reports are lost, since too many came, that counts as one.
class interface_watch final : public std::enable_shared_from_this<interface_watch> {
  public:
    /// \throws boost::system::system_error
    [[gnu::cold]] interface_watch(const boost::asio::any_io_executor& executor, std::function<void()> on_change);

    /// Call once.
    [[gnu::cold]] void start() { wait(); }
    /// `on_change` is not called any more.
    [[gnu::cold]] void stop();

  private:
    [[gnu::cold]] void wait();
    [[gnu::cold]] void on_readable(boost::system::error_code code);
    [[nodiscard, gnu::cold]] bool read_reports();

    boost::asio::posix::stream_descriptor reports_;
    std::function<void()> on_change_; // empty: stopped
};

} // namespace cles::transport
