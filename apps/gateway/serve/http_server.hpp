// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "gateway/access/client_limits.hpp"
#include "gateway/serve/connection.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace gateway {

/// Accepts the connections of clients.
class http_server {
  public:
    using log_function = std::function<void(const std::string& text)>; ///< of warnings

    /// \param tls null: without
    http_server(boost::asio::io_context& io, request_handler& handler, gateway_counts& counts, client_limits limits,
                boost::asio::ssl::context* tls, log_function log)
        : io_(io), handler_(handler), counts_(counts), limits_(std::move(limits)), tls_(tls), log_(std::move(log)) {}
    http_server(const http_server&) = delete;
    http_server& operator=(const http_server&) = delete;
    ~http_server() { stop(); }

    /// Returns the URL with the actual port. \throws cles::error
    std::string listen(const boost::asio::ip::tcp::endpoint& where);
    /// Accepts nothing more, and ends all connections.
    void stop();

  private:
    struct listener {
        listener(boost::asio::io_context& io, boost::asio::ip::tcp of) : protocol(of), acceptor(io), pause(io) {}
        boost::asio::ip::tcp protocol;
        boost::asio::ip::tcp::acceptor acceptor;
        boost::asio::steady_timer pause;
    };

    void accept(listener& at);
    void take(boost::asio::ip::tcp::socket socket);

    boost::asio::io_context& io_;
    request_handler& handler_;
    gateway_counts& counts_;
    client_limits limits_;
    boost::asio::ssl::context* tls_;
    log_function log_;
    std::optional<std::chrono::steady_clock::time_point> logged_{}; ///< that none can be accepted
    patience patience_{};
    std::list<listener> listeners_;
    std::map<std::uint64_t, std::shared_ptr<connection>> connections_;
};

} // namespace gateway
