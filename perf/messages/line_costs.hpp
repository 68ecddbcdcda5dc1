// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "direct_link.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace cles::perf {

/// What the measured messages carry: as many numbers as make the message long.
struct series {
    std::vector<double> samples;
};
BOOST_DESCRIBE_STRUCT(series, (), (samples))

/// Nanoseconds that a message takes in the means of one pass, from the line in memory to the handler's or caller's code
/// (and, of a request, until its reply stands in memory).
struct line_times {
    double head = 0;             ///< a PULL whose head is that long
    double validated = 0;        ///< a PUSH whose body is that long, and its handler does not read it
    double typed = 0;            ///< the same, read into the handler's C++ type
    double reply_validated = 0;  ///< a reply that long, to a caller who takes text
    double reply_typed = 0;      ///< the same, read into the caller's C++ type
    double packed = 0;           ///< the same numbers from a packed struct in network order
    std::size_t packed_size = 0; ///< its bytes
};

/// Two services without sockets, one that is asked and one that asks, and messages of one length for both.
class line_costs {
  public:
    line_costs();
    ~line_costs();
    line_costs(const line_costs&) = delete;
    line_costs& operator=(const line_costs&) = delete;

    /// Measures messages of so many bytes, or a few less, their LF not counted; 64 at least.
    /// \throws std::runtime_error where something is answered wrongly
    line_times measure(std::size_t bytes, std::uint64_t repetitions);

  private:
    double time_request(const std::string& line, std::uint64_t repetitions);
    template <class T>
    double time_reply(const std::string& body, std::uint64_t repetitions);

    boost::asio::io_context io_{1};
    direct_exchange exchange_;
    service car_;
    service client_;
    std::shared_ptr<direct_link> into_car_;
    std::size_t read_ = 0; ///< numbers that the typed handler got last
};

} // namespace cles::perf
