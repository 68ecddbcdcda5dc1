// SPDX-License-Identifier: BSL-1.0
#include "commands.hpp"
#include "commands/started_program.hpp"
#include "gateway/arguments.hpp"

#include <CLI/App.hpp>

#include <memory>

namespace tool {

void add_gateway(CLI::App& app, char** words) {
    auto given = std::make_shared<gateway_arguments>();
    auto* command = app.add_subcommand("gateway");
    add_gateway_arguments(*command, *given); // for help, completion, and errors of a single option
    command->callback([given, words] {
        start_program(words, "gateway", "cles-gateway",
                      "it is built and installed with cles, unless CLES_SECURITY is off");
    });
}

} // namespace tool
