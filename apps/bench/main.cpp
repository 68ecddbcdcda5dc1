// SPDX-License-Identifier: BSL-1.0
// The program that `cles bench` starts, with the options that `cles bench` was given.
#include <cles/wake_bound.hpp>

#include "arguments.hpp"
#include "measurements.hpp"
#include "output/end_of_output.hpp"
#include "output/errors.hpp"
#include "output/help_formatter.hpp"
#include "output/terminal.hpp"
#include "perf/support/pinning.hpp"

#include <CLI/CLI.hpp>

#include <csignal>
#include <exception>
#include <memory>
#include <optional>
#include <string>

namespace {

std::string measure(tool::measurement what, const tool::bench_options& options) {
    using tool::measurement;
    switch (what) {
    case measurement::pulls: return tool::measure_pulls(options);
    case measurement::updates: return tool::measure_updates(options);
    case measurement::fan_out: return tool::measure_fan_out(options);
    case measurement::bytes: return tool::measure_bytes(options);
    case measurement::parse: return tool::measure_parsing(options);
    case measurement::stress: return tool::measure_stress(options);
    case measurement::urgent: return tool::measure_urgent(options);
    }
    return {};
}

void run(const CLI::App& command, const tool::bench_arguments& given) {
    const auto what = tool::selected_measurement(command, given);
    const auto options = tool::to_options(given, what);
    std::optional<cles::wake_bound> awake;
    if (options.wake_within) {
        awake.emplace(*options.wake_within);
    }
    const bool has_two_ends = what != tool::measurement::bytes && what != tool::measurement::parse;
    if (has_two_ends && options.against.empty() && options.transport != tool::carrier::inproc && !options.one_core &&
        !cles::perf::place_ends().apart()) {
        tool::note("there is only one core: both ends share it, and the figures are not representative");
    }
    tool::write_output(measure(what, options));
}

} // namespace

int main(int argc, char** argv) {
    // A reader that closes the pipe is reported as an error of the write.
    std::signal(SIGPIPE, SIG_IGN);
    tool::check_output_at_exit("cles bench", tool::exit_code::local_failure);
    tool::bench_arguments given;
    CLI::App command{"", "cles bench"};
    command.formatter(std::make_shared<tool::help_formatter>());
    // Accepted, since `cles` accepts it after each command. A hidden option ahead of all others leaves no empty line in
    // the help text, so the help option goes behind it.
    command.set_help_flag();
    command.add_flag("-v,--verbose")->group("");
    command.set_help_flag("-h,--help", "Print this help message and exit");
    tool::add_bench_arguments(command, given);
    try {
        command.parse(argc, argv);
        run(command, given);
        return tool::exit_code::success;
    } catch (const CLI::Success& asked) { // --help
        return command.exit(asked);
    } catch (const CLI::ParseError& wrong) {
        tool::print_error(wrong.what());
        tool::note("cles help bench shows its options");
        return tool::exit_code::usage;
    } catch (...) {
        return tool::report_failure(std::current_exception());
    }
}
