// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/describe/class.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

/// What a message costs by its length, as a plot is made from it.
namespace tool {

struct parse_figure {
    double ns = 0;
    double ns_per_byte = 0; ///< of the message
};
BOOST_DESCRIBE_STRUCT(parse_figure, (), (ns, ns_per_byte))

struct parse_row {
    std::size_t bytes = 0; ///< of the message, at most
    std::uint64_t repetitions = 0;
    parse_figure head{};            ///< a request that is all head
    parse_figure validated{};       ///< a request with a body that nobody reads
    parse_figure typed{};           ///< the same, read into a C++ type
    parse_figure reply_validated{}; ///< a reply, as text
    parse_figure reply_typed{};     ///< a reply, read into a C++ type
    std::size_t packed_bytes = 0;   ///< of the struct that holds the same numbers
    parse_figure packed{};          ///< the struct; per byte of its own
};
BOOST_DESCRIBE_STRUCT(parse_row, (),
                      (bytes, repetitions, head, validated, typed, reply_validated, reply_typed, packed_bytes, packed))

struct parse_report {
    std::string bench = "parse";
    std::size_t rounds = 0;
    int core = 0;
    std::vector<parse_row> rows{};
};
BOOST_DESCRIBE_STRUCT(parse_report, (), (bench, rounds, core, rows))

std::string table_of(const parse_report& report);

} // namespace tool
