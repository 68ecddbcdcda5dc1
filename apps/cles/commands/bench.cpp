// SPDX-License-Identifier: BSL-1.0
#include "bench/arguments.hpp"
#include "commands.hpp"

#include <CLI/App.hpp>

#include <cerrno>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

#include <unistd.h>

namespace tool {
namespace {

/// Replaces this program by `cles-bench`, so that its exit code, its terminal and the signals to it are those of this
/// process. `words` follow the name of this program; those after "bench" are passed on.
[[noreturn]] void start_bench(char** words) {
    while (std::string_view{*words} != "bench") {
        ++words; // a flag of `cles`
    }
    std::string program = "cles-bench";
    *words = program.data();
    std::error_code unknown;
    const auto self = std::filesystem::read_symlink("/proc/self/exe", unknown);
    int failure = ENOENT;
    if (!unknown) {
        ::execv((self.parent_path() / program).c_str(), words);
        failure = errno;
    }
    if (failure == ENOENT) {
        ::execvp(program.c_str(), words);
        failure = errno;
    }
    throw std::runtime_error(failure == ENOENT
                                 ? "cannot find cles-bench, neither beside cles nor in PATH: it is built and installed "
                                   "with cles, unless CLES_BUILD_PERF is off"
                                 : "cannot start cles-bench: " + std::generic_category().message(failure));
}

} // namespace

void add_bench(CLI::App& app, char** words) {
    auto given = std::make_shared<bench_arguments>();
    auto* command = app.add_subcommand("bench");
    add_bench_arguments(*command, *given); // for help, completion, and errors of a single option
    command->callback([given, words] { start_bench(words); });
}

} // namespace tool
