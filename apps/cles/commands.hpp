// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace tool {

/// What the subcommands share with `main`.
struct context {
    int exit_code = 0;
    int verbosity = 0; ///< how often -v was given
};

// Each adds one subcommand, which sets the exit code when it has run.

void add_pull(CLI::App& app, context& shared);
void add_push(CLI::App& app, context& shared);
void add_delegate(CLI::App& app, context& shared);
void add_bind(CLI::App& app, context& shared);
void add_update(CLI::App& app, context& shared);
void add_ping(CLI::App& app, context& shared);
void add_hz(CLI::App& app, context& shared);
void add_sniff(CLI::App& app, context& shared);
void add_info(CLI::App& app, context& shared);
void add_ls(CLI::App& app, context& shared);
void add_top(CLI::App& app, context& shared);
void add_jobs(CLI::App& app, context& shared);
void add_trace(CLI::App& app, context& shared);
void add_doctor(CLI::App& app, context& shared);
void add_completion(CLI::App& app, context& shared);
void add_serve(CLI::App& app, context& shared);
void add_publish(CLI::App& app, context& shared);
void add_respond(CLI::App& app, context& shared);
void add_keys(CLI::App& app, context& shared);
void add_fleet(CLI::App& app, context& shared);
void add_access(CLI::App& app, context& shared);
void add_context(CLI::App& app);
void add_help(CLI::App& app, context& shared);
// `words` are the arguments of this program, ended by a null pointer. Those after the command are passed to the program
// of its own that it starts.

void add_bench(CLI::App& app, char** words);
void add_gateway(CLI::App& app, char** words);

/// A description of the program and its commands.
std::string overview_of(const CLI::App& app);

/// The name of a command with those of the commands that contain it: "cles fleet add".
std::string full_name_of(const CLI::App& command);

/// Reports on stderr that this program, or command, has no such command, and suggests a similar one.
void report_unknown_command(const CLI::App& app, const std::string& typed);

/// Suggests a similar option on stderr, if this word looks like one.
void suggest_option(const CLI::App& app, const CLI::App& command, const std::string& word);

/// The completion of a shell runs this, as `cles __complete WORD...`: the words after "cles" up to the cursor, the last
/// of which is incomplete, and may be empty. Prints the candidates for it, one per line, each with a tab and a short
/// description. It takes less than 100 ms, prints nothing else, and never fails.
int complete(CLI::App& app, std::vector<std::string> words);

} // namespace tool
