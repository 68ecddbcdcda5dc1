// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace CLI {
class App;
}

/// Each function adds one subcommand, which leaves its exit code in the context when it has run.
namespace tool {

struct context;

void add_pull(CLI::App& app, context& shared);
void add_push(CLI::App& app, context& shared);
void add_delegate(CLI::App& app, context& shared);
void add_bind(CLI::App& app, context& shared);
void add_update(CLI::App& app, context& shared);
void add_ping(CLI::App& app, context& shared);
void add_hz(CLI::App& app, context& shared);
void add_info(CLI::App& app, context& shared);
void add_ls(CLI::App& app, context& shared);
void add_top(CLI::App& app, context& shared);
void add_doctor(CLI::App& app, context& shared);
void add_completion(CLI::App& app, context& shared);
void add_serve(CLI::App& app, context& shared);
void add_help(CLI::App& app, context& shared);
/// `words` are the arguments of this program, ended by a null pointer. Those after "bench" are passed to `cles-bench`.
void add_bench(CLI::App& app, char** words);

} // namespace tool
