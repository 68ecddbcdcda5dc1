// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <boost/asio/ip/address.hpp>
#include <boost/system/error_code.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::transport {

/// What is known of the names of hosts: results for some seconds, which names are being looked up, and for whom. Each
/// name is looked up once at a time, beside the others; beyond a number of them, names wait for their turn. Sans-I/O.
class name_lookups {
  public:
    using addresses = std::vector<boost::asio::ip::address>;
    /// Without a code, there is at least one address.
    struct outcome {
        boost::system::error_code code{};
        addresses found{};
    };
    /// Stands for one that waits for an outcome.
    using ticket = std::uint64_t;

    struct bounds {
        std::size_t at_once = 64;
        std::size_t names = 1024; ///< known, being looked up, or waiting
        std::chrono::milliseconds keep_found{10'000};
        std::chrono::milliseconds keep_failed{1'000}; ///< so that one who asks again at once does not ask the network
    };

    explicit name_lookups(bounds limits) noexcept : bounds_(limits) {}

    enum class step : std::uint8_t {
        known,   ///< the outcome is in `now_known`
        waits,   ///< `finish` will return the ticket
        start,   ///< the same, and the name has to be looked up now
        refused, ///< too many names are being looked up
    };
    struct answer {
        step what;
        outcome now_known{};
    };
    answer ask(std::string_view name, ticket who, time_point now);
    /// It no longer waits. Its name is still looked up if that has begun.
    void forget(std::string_view name, ticket who);
    /// A lookup has ended. \return those who wait for it
    std::vector<ticket> finish(std::string_view name, outcome found, time_point now);
    /// A lookup could not begin. \return those who wait for it; nothing is kept
    std::vector<ticket> abort(std::string_view name);
    /// The next name that has to be looked up, after one lookup has ended.
    std::optional<std::string> next();
    /// The names that were being looked up, as in a child process, in which nobody does that any more: they have to be
    /// looked up again.
    [[nodiscard]] std::vector<std::string> running() const;

    /// Keeps which address of several has answered, for those who dial the same again. \param place host and port, or
    /// whatever distinguishes places where different addresses answer
    void prefer(std::string_view place, const boost::asio::ip::address& answered);
    [[nodiscard]] std::optional<boost::asio::ip::address> preferred(std::string_view place) const;

  private:
    enum class state : std::uint8_t { known, queued, running };
    struct entry {
        state is;
        outcome last{};
        time_point until{}; // when `last` is too old
        std::vector<ticket> waiting{};
    };
    [[nodiscard]] bool make_space(time_point now);

    bounds bounds_;
    std::map<std::string, entry, std::less<>> names_;
    std::deque<std::string> queue_;
    std::size_t running_ = 0;
    std::deque<std::pair<std::string, boost::asio::ip::address>> preferred_; // the latest first
};

} // namespace cles::transport
