// SPDX-License-Identifier: BSL-1.0
#include "bench.hpp"

#include <cles/convert.hpp>
#include <cles/wake_bound.hpp>

#include "bench_arguments.hpp"
#include "bench_run.hpp"
#include "diagnostics.hpp"
#include "exit_code.hpp"
#include "output.hpp"
#include "perf/support/pinning.hpp"

#include <CLI/CLI.hpp>

#include <memory>
#include <optional>

namespace tool {
namespace {

constexpr const char* description =
    "Measure PULL of a localization packet against a hand-written exchange of packed structs over\n"
    "blocking TCP sockets, both in one run, in turn, each server in a process of its own on another\n"
    "core. With --updates or --fan-out, measure BIND and UPDATE instead; with --stress, the steadiness\n"
    "of PULL; with --urgent, what it takes beside large answers; with --bytes, what all verbs put on the wire; with "
    "--parse, what a message costs by its\n"
    "length.";

constexpr const char* examples = "Examples:\n"
                                 "  cles bench\n"
                                 "  cles bench --transport unix\n"
                                 "  cles bench --in-flight 64 --style callback -o json\n"
                                 "  cles bench --busy-poll 50\n"
                                 "  cles bench --wake-within 0\n"
                                 "  cles bench --stress\n"
                                 "  cles bench --urgent\n"
                                 "  cles bench --against tcp://10.0.0.2\n"
                                 "  cles bench --updates --binders 8\n"
                                 "  cles bench --fan-out --binders 1,64\n"
                                 "  cles bench --bytes\n"
                                 "  cles bench --parse -o json\n";

void run(const CLI::App& command, bench_arguments& given) {
    settle(command, given);
    const auto& options = given.options;
    std::optional<cles::wake_bound> awake;
    if (options.wake_within) {
        awake.emplace(*options.wake_within);
    }
    const bool has_two_ends = given.what != measurement::bytes && given.what != measurement::parse;
    if (has_two_ends && options.against.empty() && options.transport != carrier::inproc && !options.one_core &&
        !cles::perf::place_ends().apart()) {
        note("there is one core only: both ends share it, and the figures say little");
    }
    const auto tell = [&](const auto& report) {
        write_output(given.form == "json" ? cles::to_json(report) + "\n" : table_of(report));
    };
    switch (given.what) {
    case measurement::pulls: tell(bench_pulls(options)); break;
    case measurement::updates: tell(bench_updates(options)); break;
    case measurement::fan_out: tell(bench_fan_out(options)); break;
    case measurement::bytes: tell(bench_bytes(options)); break;
    case measurement::parse: tell(bench_parse(options)); break;
    case measurement::stress: tell(bench_stress(options)); break;
    case measurement::urgent: tell(bench_urgent(options)); break;
    }
}

} // namespace

void add_bench(CLI::App& app, int& exit_code) {
    auto given = std::make_shared<bench_arguments>();
    auto* command = app.add_subcommand("bench", description);
    command->footer(examples);
    add_bench_arguments(*command, *given);
    command->callback([command, given, &exit_code] {
        run(*command, *given);
        exit_code = exit_code::success;
    });
}

} // namespace tool
