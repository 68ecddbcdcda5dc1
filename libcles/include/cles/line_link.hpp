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

/// What a link tells its owner, on the link's executor.
///
/// Order: any number of lines in batches, each closed by `on_batch`; then `on_overlong` or `on_end`, once, if the peer
/// sends such; and last `on_lost`, once, unless the owner closed the link itself. Nothing follows `link::close`.
class link_events {
  public:
    virtual ~link_events() = default;
    /// A line without its LF, valid for the call.
    virtual void on_line(std::string_view line) = 0;
    /// What there is of a line over the limit. No more lines come.
    virtual void on_overlong(std::string_view head) = 0;
    /// All lines of one read have been handed over: the time to answer them in one write.
    virtual void on_batch() = 0;
    /// The peer has ended in the middle of this line; `on_end` follows.
    virtual void on_cut(std::string_view) {}
    /// The peer sends no more, but may still read.
    virtual void on_end() = 0;
    /// The link is gone: reset, failed to write, or closed for good.
    virtual void on_lost(boost::system::error_code why) = 0;
    /// What was written has been taken by the transport to the last byte, after `flush` could not deliver all at once.
    virtual void on_room() = 0;
};

/// A two-way carrier of lines between two nodes: what a transport provides (docs/links.md). Each transport passes one
/// contract suite, test/contract.
///
/// Used on one executor. Output is appended to `output()` as whole lines, LF included, and leaves with the next
/// `flush`.
///
/// Where `datagram()` is not 0, each line is a datagram of its own, which may be lost, come twice and overtake others.
/// Then a line may hold further LFs (the sender's mistake, told by the session), nothing ends, and a line over the
/// limit is told without an end to the others.
class link {
  public:
    link() = default;
    link(const link&) = delete;
    link& operator=(const link&) = delete;
    virtual ~link() = default;

    /// Begins to read. The link keeps its owner alive until it is closed or lost.
    virtual void start(std::shared_ptr<link_events> owner) = 0;
    virtual std::string& output() = 0;
    /// Lines that go before what waits there. By default nothing does.
    virtual std::string& urgent_output() { return output(); }
    /// Bytes of a datagram at most, a line's LF among them; 0 where the link is a stream.
    [[nodiscard]] virtual std::size_t datagram() const noexcept { return 0; }
    /// Tries to hand the output to the transport at once; what it does not take follows when it does. A link of
    /// datagrams takes the output in any case: what stands there at the next flush is new.
    virtual void flush() = 0;
    /// Bytes that the transport has not taken yet.
    [[nodiscard]] virtual std::size_t unsent() const noexcept = 0;
    /// Bytes that it has taken so far, to tell a slow peer from one that takes nothing.
    [[nodiscard]] virtual std::uint64_t sent() const noexcept = 0;
    [[nodiscard]] virtual std::uint64_t received() const noexcept = 0;
    /// Stops handing over lines, and goes on again. Lines that were read already wait.
    virtual void pause(bool stop) = 0;
    /// Writes what is left, shuts the sending side, discards input until the peer ends too (for `limits::discard` at
    /// most), and closes; `on_lost` follows.
    virtual void finish() = 0;
    /// Closes at once. Nothing follows.
    virtual void close() = 0;
    /// Bytes of memory that it holds for what it reads and writes.
    [[nodiscard]] virtual std::size_t buffered() const noexcept { return 0; }
    /// Gives back what it does not need while nothing goes on; called when nothing has for a while.
    virtual void shrink() {}
    [[nodiscard]] virtual const identity& peer() const noexcept = 0;
};

using link_ptr = std::shared_ptr<link>;

/// Where links come in.
class acceptor {
  public:
    acceptor() = default;
    acceptor(const acceptor&) = delete;
    acceptor& operator=(const acceptor&) = delete;
    virtual ~acceptor() = default;
    /// Where it listens, with the port that it was given.
    [[nodiscard]] virtual url local() const = 0;
    /// Hands every link that comes in to the callback; problems that pass (no descriptors left) go to the log.
    virtual void start(std::function<void(link_ptr)> on_link) = 0;
    /// Hands over the links that have connected already, also one that is being accepted when `close` follows: `close`
    /// alone resets them, and their peers could not know whether what they have sent was run.
    virtual void accept_waiting() {}
    virtual void close() = 0;
};

using dial_callback = std::function<void(boost::system::error_code, link_ptr)>;

} // namespace cles
