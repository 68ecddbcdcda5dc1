// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>
#include <cles/url.hpp>

#include <boost/system/error_code.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles {

/// The events of a link, on the link's executor.
///
/// Order: any number of lines in batches, each followed by `on_batch`; then `on_overlong` or `on_end`, at most once;
/// last `on_lost`, once, unless the owner closed the link. No events follow `link::close`.
class link_events {
  public:
    virtual ~link_events() = default;
    /// A line without its LF; valid during the call.
    virtual void on_line(std::string_view line) = 0;
    /// The beginning of a line that exceeds the limit. No more lines follow.
    virtual void on_overlong(std::string_view head) = 0;
    /// All lines of one read have been delivered, so the replies can be written together.
    virtual void on_batch() = 0;
    /// The peer ended its stream in the middle of this line; `on_end` follows.
    virtual void on_cut(std::string_view) {}
    /// The peer sends no more, but may still read.
    virtual void on_end() = 0;
    /// The connection is lost: reset, failed to write, or closed.
    virtual void on_lost(boost::system::error_code why) = 0;
    /// The transport has accepted all output, after a `flush` that could not write all at once.
    virtual void on_writable() = 0;
    /// Over datagrams: the peer has restarted, and has another epoch. It may have received what was sent before, or
    /// not.
    virtual void on_restart() {}
    /// The binding of this noun, as it was made on the link, has ended; all else goes on.
    virtual void on_binding_lost(std::string_view /*noun*/, const std::string& /*why*/) {}
    /// Over datagrams: the peer does not prove its name. \param lost what is sent to it is lost meanwhile
    virtual void on_unanswered(bool /*lost*/) {}
    /// The former name of `on_writable`, for callers.
    [[deprecated("on_writable")]] void on_room() { on_writable(); }
};

/// A bidirectional connection that carries lines between two nodes; implemented by transports (docs/links.md). All
/// transports pass the same tests, test/contract.
///
/// Use it on one executor. Append whole lines, including LF, to `output()`; the next `flush` sends them.
///
/// If `datagram()` is not 0, each line is a datagram, which may be lost, duplicated or reordered. Then a line may
/// contain further LFs (an error of the sender, which the session reports), there is no end of the stream, and after an
/// overlong line others follow.
class link {
  public:
    link() = default;
    link(const link&) = delete;
    link& operator=(const link&) = delete;
    virtual ~link() = default;

    /// Starts reading. The link keeps its owner alive until it is closed or lost.
    virtual void start(std::shared_ptr<link_events> owner) = 0;
    virtual std::string& output() = 0;
    /// Output that is sent before other lines that are queued there. By default the same as `output()`.
    virtual std::string& urgent_output() { return output(); }
    /// The maximum size of a datagram in bytes, including LF; 0 if the link is a stream.
    [[nodiscard]] virtual std::size_t datagram() const noexcept { return 0; }
    /// Passes the output to the transport. What the transport does not accept at once is sent as soon as it does. A
    /// datagram link always consumes the output.
    virtual void flush() = 0;
    /// Bytes that the transport has not accepted yet.
    [[nodiscard]] virtual std::size_t unsent() const noexcept = 0;
    /// Bytes that it has accepted so far, to distinguish a slow peer from one that reads nothing.
    [[nodiscard]] virtual std::uint64_t sent() const noexcept = 0;
    [[nodiscard]] virtual std::uint64_t received() const noexcept = 0;
    /// Stops or resumes the delivery of lines. Lines that have already been read are kept.
    virtual void pause(bool stop) = 0;
    /// Writes the remaining output, shuts down the sending side, discards input until the peer ends too (for at most
    /// `limits::discard`), and closes; `on_lost` follows.
    virtual void finish() = 0;
    /// Closes at once. No events follow.
    virtual void close() = 0;
    /// Bytes of memory that it holds for reading and writing.
    [[nodiscard]] virtual std::size_t buffered() const noexcept { return 0; }
    /// Frees unused memory; called after the link has been idle for a while.
    virtual void shrink() {}
    [[nodiscard]] virtual const identity& peer() const noexcept = 0;
    /// The epoch that the peer has stated when it proved its name: eight hexadecimal digits. Empty if the transport
    /// authenticates no names. Complete when the first line arrives.
    [[nodiscard]] virtual std::string_view epoch() const noexcept { return {}; }
    /// A request is sent again over datagrams. If nothing was received since its last copy, and the link
    /// authenticates its peer, it finds out whether that has restarted.
    virtual void check_peer(time_point /*since*/) {}
};

using link_ptr = std::shared_ptr<link>;

/// A listener for incoming links.
class acceptor {
  public:
    acceptor() = default;
    acceptor(const acceptor&) = delete;
    acceptor& operator=(const acceptor&) = delete;
    virtual ~acceptor() = default;
    /// The URL that it listens on, with the actual port.
    [[nodiscard]] virtual url local() const = 0;
    /// Calls `on_link` for each incoming link; temporary problems (such as no free descriptors) are logged.
    virtual void start(std::function<void(link_ptr)> on_link) = 0;
    /// Delivers the links that are already connected, including one that is being accepted when `close` follows.
    /// `close` alone resets them, and their peers could not know whether their requests have run.
    virtual void accept_waiting() {}
    virtual void close() = 0;
};

using dial_callback = std::function<void(boost::system::error_code, link_ptr)>;

} // namespace cles
