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

/// The body of the measured messages, with as many numbers as their length requires.
struct series {
    std::vector<double> samples;
};
BOOST_DESCRIBE_STRUCT(series, (), (samples))

/// Nanoseconds for a message, the mean of one pass: from the line in memory to the handler's or caller's code, and for
/// a request until its reply is in memory.
struct line_times {
    double head = 0;             ///< a PULL whose head has that length
    double validated = 0;        ///< a PUSH whose body has that length, and is not read by the handler
    double typed = 0;            ///< the same, read into the handler's C++ type
    double reply_validated = 0;  ///< a reply of that length, delivered as text
    double reply_typed = 0;      ///< the same, read into the caller's C++ type
    double packed = 0;           ///< the same numbers from a packed struct in network order
    std::size_t packed_size = 0; ///< its bytes
};

/// A server and a client without sockets.
class line_costs {
  public:
    line_costs();
    ~line_costs();
    line_costs(const line_costs&) = delete;
    line_costs& operator=(const line_costs&) = delete;

    /// Measures messages of this number of bytes, or a few less, without their LF. \pre `bytes` >= 64
    /// \throws std::runtime_error if an answer is wrong
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
    std::size_t read_ = 0; ///< numbers that the typed handler received last
};

} // namespace cles::perf
