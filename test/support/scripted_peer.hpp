// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include <boost/asio/io_context.hpp>

#include <cstddef>
#include <memory>
#include <source_location>
#include <string>
#include <string_view>

namespace cles::test {

/// Small ones have little capacity, so that an unread stream fills up soon.
enum class buffers { usual, small };

/// A plain socket with which a test plays the peer of a link byte by byte. While it waits, it runs the link's context;
/// what it waits for has to arrive within `patience`.
class scripted_peer {
  public:
    using place = std::source_location;

    /// Connects to a listener.
    scripted_peer(boost::asio::io_context& io, std::string_view url, buffers size = buffers::usual);
    /// Takes ownership of a connected socket.
    scripted_peer(boost::asio::io_context& io, int descriptor) noexcept : io_(&io), descriptor_(descriptor) {}
    scripted_peer(scripted_peer&& other) noexcept;
    scripted_peer& operator=(scripted_peer&& other) noexcept;
    ~scripted_peer() { close(); }

    /// Sends all of it.
    void send(std::string_view bytes, const place& where = place::current());
    /// Sends what the socket accepts at once; returns the number of bytes.
    std::size_t send_some(std::string_view bytes);
    /// The next line, without its LF.
    std::string line(const place& where = place::current());
    /// Sends a line and returns the reply.
    std::string ask(std::string_view line, const place& where = place::current());
    /// Everything that arrives until the end of the stream (or a reset).
    std::string rest(const place& where = place::current());
    /// Whether the stream has ended; reads what has arrived.
    bool ended();
    /// The bytes that have arrived and have not been returned.
    [[nodiscard]] std::string unread() const { return input_.substr(taken_); }
    /// Whether the stream ended by a reset.
    [[nodiscard]] bool was_reset() const noexcept { return reset_; }

    /// Shuts down the sending side.
    void shut();
    /// Closes with a reset.
    void reset();
    void close();

  private:
    void read_ready();

    boost::asio::io_context* io_;
    int descriptor_ = -1;
    std::string input_{};
    std::size_t taken_ = 0; // how much of the input `line` has returned
    bool ended_ = false;
    bool reset_ = false;
};

/// A plain listening socket; each accepted connection is a scripted peer.
class scripted_listener {
  public:
    explicit scripted_listener(boost::asio::io_context& io, std::string_view url = "tcp://127.0.0.1:0",
                               int backlog = 16);
    scripted_listener(const scripted_listener&) = delete;
    scripted_listener& operator=(const scripted_listener&) = delete;
    ~scripted_listener();

    /// The URL at which it listens, with its port.
    [[nodiscard]] std::string url() const { return to_string(where_); }
    scripted_peer accept(const std::source_location& where = std::source_location::current());

  private:
    boost::asio::io_context& io_;
    int descriptor_;
    cles::url where_;
};

} // namespace cles::test
