// SPDX-License-Identifier: BSL-1.0
#include "figures.hpp"
#include "measurements.hpp"
#include "perf/messages/line_costs.hpp"
#include "perf/support/pinning.hpp"
#include "progress.hpp"
#include "report_table.hpp"

#include <boost/describe/class.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace tool {

namespace perf = cles::perf;

namespace {

/// What a message costs by its length.
struct parse_figure {
    double ns = 0;
    double ns_per_byte = 0; ///< of the message
};
BOOST_DESCRIBE_STRUCT(parse_figure, (), (ns, ns_per_byte))

struct parse_row {
    std::size_t bytes = 0; ///< of the message, at most
    std::uint64_t repetitions = 0;
    parse_figure head{};            ///< a request that is all head
    parse_figure validated{};       ///< a request whose body is checked, but not read
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

/// "4096 (1.00)"
std::string cell(const parse_figure& figure) { return fixed(figure.ns, 0) + " (" + fixed(figure.ns_per_byte, 2) + ")"; }

std::string table_of(const parse_report& report) {
    rows out{{"bytes", "head", "validated", "typed", "reply", "reply typed", "struct bytes", "struct"}};
    for (const auto& row : report.rows) {
        out.add({std::to_string(row.bytes), cell(row.head), cell(row.validated), cell(row.typed),
                 cell(row.reply_validated), cell(row.reply_typed), std::to_string(row.packed_bytes), cell(row.packed)});
    }
    return out.text() + "ns (ns per byte), medians of " + std::to_string(report.rounds) + " rounds on core " +
           std::to_string(report.core) +
           ", without sockets: from the request line to the reply; from the reply line to the caller;\n"
           "from a struct in network order to the same numbers\n";
}

constexpr std::size_t smallest = 64;
constexpr std::size_t largest = std::size_t{1} << 20U; // what a line may have
constexpr std::size_t bytes_of_a_pass = std::size_t{8} << 20U;

std::uint64_t repetitions_of(std::size_t bytes, const bench_options& options) {
    return options.requests != 0 ? options.requests : std::clamp<std::uint64_t>(bytes_of_a_pass / bytes, 8, 20'000);
}

parse_row row_of(std::size_t bytes, std::uint64_t repetitions, const std::vector<perf::line_times>& passes) {
    const medians of{passes};
    const auto figure = [&](double perf::line_times::*time, std::size_t per) {
        const double ns = of(time);
        return parse_figure{.ns = ns, .ns_per_byte = over(ns, static_cast<double>(per))};
    };
    using times = perf::line_times;
    const auto packed_bytes = passes.front().packed_size;
    return {.bytes = bytes,
            .repetitions = repetitions,
            .head = figure(&times::head, bytes),
            .validated = figure(&times::validated, bytes),
            .typed = figure(&times::typed, bytes),
            .reply_validated = figure(&times::reply_validated, bytes),
            .reply_typed = figure(&times::reply_typed, bytes),
            .packed_bytes = packed_bytes,
            .packed = figure(&times::packed, packed_bytes)};
}

} // namespace

std::string measure_parsing(const bench_options& options) {
    const auto core = perf::place_ends().client;
    perf::pin_to(core);
    perf::line_costs costs;

    std::vector<std::size_t> sizes;
    for (auto bytes = smallest; bytes <= largest; bytes *= 4) {
        sizes.push_back(bytes);
    }
    std::vector<std::vector<perf::line_times>> passes(sizes.size());
    bench_progress progress{options.rounds * sizes.size()};
    for (std::size_t round = 0; round < options.rounds; ++round) {
        for (std::size_t i = 0; i < sizes.size(); ++i) {
            progress.step(std::to_string(sizes[i]) + " bytes");
            const auto repetitions = repetitions_of(sizes[i], options);
            costs.measure(sizes[i], std::max<std::uint64_t>(1, repetitions / 10)); // warms up
            passes[i].push_back(costs.measure(sizes[i], repetitions));
        }
    }

    parse_report report{.rounds = options.rounds, .core = core};
    for (std::size_t i = 0; i < sizes.size(); ++i) {
        report.rows.push_back(row_of(sizes[i], repetitions_of(sizes[i], options), passes[i]));
    }
    return text_of(report, options);
}

} // namespace tool
