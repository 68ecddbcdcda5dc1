// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <boost/asio/ip/address.hpp>

#include <chrono>
#include <cstddef>
#include <optional>
#include <vector>

namespace cles::transport {

/// The addresses of a host in the order in which they are tried: first the preferred one, if it is among them; then the
/// system's order, but with IPv6 and IPv4 in turn (RFC 8305, section 4), so that an address is tried soon if one family
/// has no route. Each is there once, and there are at most `most_addresses`.
std::vector<boost::asio::ip::address> in_connection_order(const std::vector<boost::asio::ip::address>& found,
                                                          const std::optional<boost::asio::ip::address>& preferred);
inline constexpr std::size_t most_addresses = 16;

/// Which of several addresses is tried next, and when (RFC 8305, section 5): when the last has failed or has been
/// silent for 250 ms. The first to answer wins, which the owner decides. Sans-I/O.
class address_race {
  public:
    static constexpr std::chrono::milliseconds patience{250};
    /// More time for an address that has accepted the connection, but has still to prove who it is.
    static constexpr std::chrono::seconds patience_once_accepted{1};

    explicit address_race(std::size_t count) noexcept : count_(count) {}

    /// The number of the address to try now. Call it until it returns nothing, and again at `due`.
    std::optional<std::size_t> next(time_point now) noexcept;
    /// Nothing: all have been tried.
    [[nodiscard]] std::optional<time_point> due() const noexcept;
    /// One that was tried has failed.
    void fail(time_point now) noexcept;
    /// One that was tried has accepted the connection.
    void accept(time_point now) noexcept;
    /// Whether all have failed.
    [[nodiscard]] bool is_lost() const noexcept { return failed_ == count_; }

  private:
    std::size_t count_;
    std::size_t tried_ = 0;
    std::size_t failed_ = 0;
    time_point due_{};
};

/// When addresses that are asked by datagram, which may be lost, are asked again. Sans-I/O.
class probe_times {
  public:
    static constexpr std::chrono::milliseconds first_pause{200};
    static constexpr std::chrono::milliseconds longest_pause{5000};

    /// The first question has been sent.
    explicit probe_times(time_point now) noexcept : due_(now + first_pause) {}

    [[nodiscard]] time_point due() const noexcept { return due_; }
    /// Whether to ask again now.
    bool next(time_point now) noexcept;

  private:
    std::chrono::milliseconds pause_ = first_pause;
    time_point due_;
};

} // namespace cles::transport
