// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "support/link_recorder.hpp"
#include "support/run_until.hpp"
#include "support/side_thread.hpp"

#include <boost/asio/io_context.hpp>

#include <array>
#include <chrono>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

namespace cles::test {

/// All kinds of links.
enum class carrier { tcp4, tcp6, tls, unix_file, unix_abstract, inproc, inproc_threads, udp4, udp6 };

#ifdef CLES_TEST_TLS
#define CLES_TLS_CARRIER carrier::tls,
#else
#define CLES_TLS_CARRIER
#endif

/// The streams, all of which fulfil the same contract. Only test/contract has a transport for `tls`.
inline constexpr std::array every_carrier{CLES_TLS_CARRIER carrier::tcp4, carrier::tcp6,   carrier::unix_file,
                                          carrier::unix_abstract,         carrier::inproc, carrier::inproc_threads};
/// Those that need the kernel.
inline constexpr std::array every_stream{CLES_TLS_CARRIER carrier::tcp4, carrier::tcp6, carrier::unix_file,
                                         carrier::unix_abstract};
/// Those that a bare socket can speak to.
inline constexpr std::array every_socket{carrier::tcp4, carrier::tcp6, carrier::unix_file, carrier::unix_abstract};

/// Those that send each line as one datagram.
inline constexpr std::array every_datagram{carrier::udp4, carrier::udp6};
/// All of them, for tests of listening and dialling.
inline constexpr std::array listening_carriers{
    CLES_TLS_CARRIER carrier::tcp4, carrier::tcp6, carrier::unix_file, carrier::unix_abstract, carrier::inproc,
    carrier::inproc_threads,        carrier::udp4, carrier::udp6};
#undef CLES_TLS_CARRIER

std::ostream& operator<<(std::ostream& out, carrier kind);

/// An address to listen on that is not in use.
std::string fresh_address(carrier kind);

/// One end of a link, with its owner.
struct link_end {
    std::shared_ptr<link_recorder> events = std::make_shared<link_recorder>();
    link_ptr link{};
    side_thread* home = nullptr; ///< the thread on which it runs, if not the test's

    /// Uses the link or its owner on their thread.
    template <class F>
    auto run(F f) -> std::invoke_result_t<F&> {
        return home != nullptr ? home->run(std::move(f)) : f();
    }
    /// Passes the owner to the link.
    void start();
    /// Writes the lines and flushes.
    void say(std::string_view lines);
    [[nodiscard]] std::size_t lines() {
        return run([this] { return events->lines.size(); });
    }
    [[nodiscard]] std::size_t unsent() {
        return run([this] { return link->unsent(); });
    }
    [[nodiscard]] bool lost() {
        return run([this] { return events->lost(); });
    }
    [[nodiscard]] bool over() {
        return run([this] { return events->over(); });
    }
    /// Ends the link and releases it.
    void drop();
};

/// A listener and links of one kind. `near` is the end that dials, on the test's thread; `far` is the accepted one.
class link_pair {
  public:
    explicit link_pair(carrier kind, const limits& bounds = {});
    ~link_pair();
    link_pair(const link_pair&) = delete;
    link_pair& operator=(const link_pair&) = delete;

    boost::asio::io_context io;
    link_end near;
    link_end far;

    [[nodiscard]] link_transport& transport() const noexcept { return *transport_; }
    [[nodiscard]] const limits& bounds() const noexcept { return bounds_; }
    [[nodiscard]] url address() const { return address_; }
    /// The other end's context.
    [[nodiscard]] boost::asio::io_context& far_io() { return thread_ ? thread_->io() : io; }

    /// Makes the link without starting its ends. Over datagrams, the near end sends "hello", since only that makes a
    /// link.
    void connect();
    /// Makes the link and starts both ends.
    void open();
    /// Waits for a link that `connect` did not make.
    void accept();
    void stop_listening();

    template <class Condition>
    void until(Condition&& holds, const std::source_location& where = std::source_location::current()) {
        run_until(io, std::forward<Condition>(holds), patience, where);
    }

  private:
    std::unique_ptr<side_thread> thread_;
    limits bounds_;
    link_transport* transport_;
    url address_;
    std::unique_ptr<acceptor> acceptor_;
    link_ptr arrived_; // used on the far end's thread
};

} // namespace cles::test
