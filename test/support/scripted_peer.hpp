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

/// Small ones hold little, so that it shows soon that nobody reads.
enum class buffers { usual, small };

/// A plain socket in the hands of a test, which plays the peer of a link byte by byte. While it waits it runs the
/// context that the link lives on; whatever it waits for has to come within `patience`.
class scripted_peer {
  public:
    using place = std::source_location;

    /// Connects to where something listens.
    scripted_peer(boost::asio::io_context& io, std::string_view url, buffers size = buffers::usual);
    /// Takes over a connected socket.
    scripted_peer(boost::asio::io_context& io, int descriptor) noexcept : io_(&io), descriptor_(descriptor) {}
    scripted_peer(scripted_peer&& other) noexcept;
    scripted_peer& operator=(scripted_peer&& other) noexcept;
    ~scripted_peer() { close(); }

    /// Sends all of it.
    void send(std::string_view bytes, const place& where = place::current());
    /// Sends what the socket takes at once; returns how much that was.
    std::size_t send_some(std::string_view bytes);
    /// The next line, without its LF.
    std::string line(const place& where = place::current());
    /// Sends a line and returns the one that answers it.
    std::string ask(std::string_view line, const place& where = place::current());
    /// All that comes until the end of the stream (or a reset).
    std::string rest(const place& where = place::current());
    /// Whether the stream has ended; takes in what has come so far.
    bool ended();
    /// The bytes that have come and were not asked for yet.
    [[nodiscard]] std::string unread() const { return input_.substr(taken_); }
    /// What was read after the script ended by a reset instead of an end.
    [[nodiscard]] bool was_reset() const noexcept { return reset_; }

    /// Ends the sending side.
    void shut();
    /// Closes with a reset.
    void reset();
    void close();

  private:
    void read_ready();

    boost::asio::io_context* io_;
    int descriptor_ = -1;
    std::string input_{};
    std::size_t taken_ = 0; // of the input, by `line`
    bool ended_ = false;
    bool reset_ = false;
};

/// A plain listening socket; what comes in is a peer to script.
class scripted_listener {
  public:
    explicit scripted_listener(boost::asio::io_context& io, std::string_view url = "tcp://127.0.0.1:0",
                               int backlog = 16);
    scripted_listener(const scripted_listener&) = delete;
    scripted_listener& operator=(const scripted_listener&) = delete;
    ~scripted_listener();

    /// Where it listens, with its port.
    [[nodiscard]] std::string url() const { return to_string(where_); }
    scripted_peer accept(const std::source_location& where = std::source_location::current());

  private:
    boost::asio::io_context& io_;
    int descriptor_;
    cles::url where_;
};

} // namespace cles::test
