// SPDX-License-Identifier: BSL-1.0
#include <cles/version.hpp>

#include "commands.hpp"
#include "output/end_of_output.hpp"
#include "output/errors.hpp"
#include "output/help_formatter.hpp"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <csignal>
#include <exception>
#include <iostream>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace {

constexpr auto about = "Sends requests to the nodes of a CLES network, and inspects them.";

constexpr auto footer =
    "Data goes to stdout, everything else to stderr. CLES_AT is the default of --at, CLES_MULTICAST that of "
    "--multicast, CLES_KEYS that of --keys, CLES_POOL that of --pool; 'cles context' saves such options. NO_COLOR "
    "disables colours.\n\n"
    "Exit codes: 0 ok, 1 local failure, 2 usage, 3 no such target or task, 4 deadline,\n"
    "5 remote error, 6 busy, 130 interrupted.\n\n"
    "Examples:\n"
    "  cles serve                      # in one terminal\n"
    "  cles ls                         # in another\n"
    "  cles pull car1:localization\n"
    "  cles bind car1:localization\n"
    "  cles delegate car1:sleep/3000";

// The command that was given, or the program itself.
const CLI::App& command_of(const CLI::App& app) {
    const CLI::App* out = &app;
    for (auto given = out->get_subcommands(); !given.empty(); given = out->get_subcommands()) {
        out = given.front();
    }
    return *out;
}

int run(CLI::App& app, tool::context& shared, int argc, char** argv) {
    try {
        app.parse(argc, argv);
        return shared.exit_code;
    } catch (const CLI::Success& request) { // --help, --version
        return app.exit(request);
    } catch (const CLI::ParseError& error) {
        const auto& command = command_of(app);
        const auto unknown = app.remaining(true);
        const bool has_commands = command.get_require_subcommand_min() > 0;
        if (has_commands && !unknown.empty()) {
            tool::report_unknown_command(command, unknown.front());
        } else {
            tool::print_error(error.what());
        }
        if (&command == &app && unknown.empty()) {
            std::cerr << '\n' << tool::overview_of(app);
            return tool::exit_code::usage;
        }
        for (const auto& word : unknown) {
            tool::suggest_option(app, command, word);
        }
        const auto help = "cles help" + tool::full_name_of(command).substr(app.get_name().size());
        tool::note(help + (has_commands ? " lists the commands" : " shows its options"));
        return tool::exit_code::usage;
    }
}

} // namespace

int main(int argc, char** argv) {
    // If the reader of the output is gone, the write fails, which ends the command silently.
    std::signal(SIGPIPE, SIG_IGN);
    tool::check_output_at_exit("cles", tool::exit_code::local_failure);
    try {
        tool::context shared;
        CLI::App app{about, "cles"};
        app.formatter(std::make_shared<tool::help_formatter>()); // before there are commands, which take it over
        app.footer(footer);
        app.fallthrough();
        app.require_subcommand(1);
        app.set_version_flag("--version", "cles " + std::string{cles::version});
        app.add_flag("-v,--verbose", shared.verbosity, "Log more on stderr; twice: also every line sent and received");
        tool::add_pull(app, shared);
        tool::add_push(app, shared);
        tool::add_delegate(app, shared);
        tool::add_bind(app, shared);
        tool::add_update(app, shared);
        tool::add_ping(app, shared);
        tool::add_hz(app, shared);
        tool::add_sniff(app, shared);
        tool::add_info(app, shared);
        tool::add_ls(app, shared);
        tool::add_top(app, shared);
        tool::add_jobs(app, shared);
        tool::add_trace(app, shared);
        tool::add_doctor(app, shared);
        tool::add_completion(app, shared);
        tool::add_serve(app, shared);
        tool::add_publish(app, shared);
        tool::add_respond(app, shared);
        tool::add_gateway(app, argv + 1);
#ifdef CLES_SECURITY
        tool::add_keys(app, shared);
        tool::add_fleet(app, shared);
        tool::add_access(app, shared);
#endif
        tool::add_context(app);
        tool::add_help(app, shared);
        tool::add_bench(app, argv + 1);
        if (argc > 1 && std::string_view{argv[1]} == "__complete") {
            return tool::complete(app, {argv + 2, argv + argc});
        }
        return run(app, shared, argc, argv);
    } catch (...) {
        return tool::report_failure(std::current_exception());
    }
}
