// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/system/error_code.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

namespace boost::asio::ssl {
class context;
} // namespace boost::asio::ssl

namespace gateway {

/// The bytes from and to a client, with TLS or without. At most one read and one write are pending. What is called when
/// they end keeps the owner of this alive.
class client_stream {
  public:
    using done = std::function<void(boost::system::error_code, std::size_t)>;

    client_stream() = default;
    client_stream(const client_stream&) = delete;
    client_stream& operator=(const client_stream&) = delete;
    virtual ~client_stream() = default;

    virtual void handshake(done then) = 0;
    virtual void read(boost::asio::mutable_buffer into, done then) = 0;
    /// Writes all of it.
    virtual void write(boost::asio::const_buffer from, done then) = 0;
    [[nodiscard]] virtual boost::asio::ip::tcp::socket& socket() = 0;

    /// Nothing more is written. What the client sends can still be read.
    void shutdown();
    /// Ends what is pending.
    void close();
    /// Limits what the system keeps for a client that does not read, so that it gets newer events when it reads again.
    void keep_little();
};

std::unique_ptr<client_stream> plain_stream(boost::asio::ip::tcp::socket socket);
std::unique_ptr<client_stream> tls_stream(boost::asio::ip::tcp::socket socket, boost::asio::ssl::context& with);

/// TLS of a server with this certificate and its key, in PEM. \throws std::runtime_error with a message for people
std::shared_ptr<boost::asio::ssl::context> tls_context(const std::string& certificate, const std::string& key);

} // namespace gateway
