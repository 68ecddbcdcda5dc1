// SPDX-License-Identifier: BSL-1.0
#include "bench/arguments.hpp"
#include "commands.hpp"
#include "commands/started_program.hpp"

#include <CLI/App.hpp>

#include <memory>

namespace tool {

void add_bench(CLI::App& app, char** words) {
    auto given = std::make_shared<bench_arguments>();
    auto* command = app.add_subcommand("bench");
    add_bench_arguments(*command, *given); // for help, completion, and errors of a single option
    command->callback([given, words] {
        start_program(words, "bench", "cles-bench",
                      "it is built and installed with cles, unless CLES_BUILD_PERF is off");
    });
}

} // namespace tool
