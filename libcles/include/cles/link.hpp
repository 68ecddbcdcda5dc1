// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/line_link.hpp>
#include <cles/url.hpp>

#include <boost/asio/any_io_executor.hpp>

#include <functional>
#include <memory>
#include <string_view>

namespace cles {

/// A way to make links, chosen by the URL's scheme.
class link_transport {
  public:
    link_transport() = default;
    link_transport(const link_transport&) = delete;
    link_transport& operator=(const link_transport&) = delete;
    virtual ~link_transport() = default;

    /// Whether listening there is reachable from other hosts.
    [[nodiscard]] virtual bool is_exposed(const url& where) const = 0;
    /// \throws boost::system::system_error where the address cannot be had
    virtual std::unique_ptr<acceptor> listen(const boost::asio::any_io_executor& executor, const url& where,
                                             const limits& bounds) = 0;
    /// Makes a link; the callback comes once, never from inside the call, within `limits::connect`. The function that
    /// is returned gives up; the callback then does not come.
    virtual std::function<void()> dial(const boost::asio::any_io_executor& executor, const url& where,
                                       const limits& bounds, dial_callback done) = 0;
};

/// The transport of a scheme, or null.
link_transport* find_transport(std::string_view scheme);
/// Adds a transport for the life of the process. To be called before any service is made.
/// \return the one whose place it takes, which it may wrap; null where there was none
std::unique_ptr<link_transport> register_transport(std::string_view scheme, std::unique_ptr<link_transport> carrier);

} // namespace cles
