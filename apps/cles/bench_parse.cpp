// SPDX-License-Identifier: BSL-1.0
#include "bench_medians.hpp"
#include "bench_progress.hpp"
#include "bench_run.hpp"
#include "perf/messages/line_costs.hpp"
#include "perf/support/pinning.hpp"

#include <algorithm>
#include <string>
#include <vector>

namespace tool {

namespace perf = cles::perf;

namespace {

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

parse_report bench_parse(const bench_options& options) {
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
    return report;
}

} // namespace tool
