// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/line_link.hpp>
#include <cles/url.hpp>

#include <boost/asio/any_io_executor.hpp>

#include <functional>
#include <memory>
#include <string_view>
#include <utility>

namespace cles {

/// Makes links; selected by the URL's scheme.
class link_transport {
  public:
    link_transport() = default;
    link_transport(const link_transport&) = delete;
    link_transport& operator=(const link_transport&) = delete;
    virtual ~link_transport() = default;

    /// Whether its links are encrypted, and lead to nodes that have proved their names. Services with security use no
    /// others between hosts.
    [[nodiscard]] virtual bool authenticates() const { return false; }
    /// Whether a listener on this URL is reachable from other hosts.
    [[nodiscard]] virtual bool is_exposed(const url& where) const = 0;
    /// \throws boost::system::system_error if the address is not available
    virtual std::unique_ptr<acceptor> listen(const boost::asio::any_io_executor& executor, const url& where,
                                             const limits& bounds) = 0;
    /// Connects. Calls `done` once, within `limits::connect`, and never from inside this call. The returned function
    /// cancels; `done` is then not called.
    virtual std::function<void()> dial(const boost::asio::any_io_executor& executor, const url& where,
                                       const limits& bounds, dial_callback done) = 0;
    /// As above, to the node of that name: a transport that authenticates its peers connects to no other. An empty name
    /// stands for any node.
    virtual std::function<void()> dial_node(const boost::asio::any_io_executor& executor, const url& where,
                                            std::string_view, const limits& bounds, dial_callback done) {
        return dial(executor, where, bounds, std::move(done));
    }
};

/// The transport for this scheme; null if there is none.
link_transport* find_transport(std::string_view scheme);
/// Registers a transport until the process ends. Call it before any service is made.
/// \return the transport that it replaces, which it may wrap; null if there was none
std::unique_ptr<link_transport> register_transport(std::string_view scheme, std::unique_ptr<link_transport> carrier);

} // namespace cles
