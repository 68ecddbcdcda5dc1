// SPDX-License-Identifier: BSL-1.0
#include "commands.hpp"
#include "commands/request_command.hpp"
#include "context.hpp"

#include <CLI/App.hpp>

#include <memory>

namespace tool {

void add_update(CLI::App& app, context& shared) {
    auto request = std::make_shared<request_command>(cles::verb::update, shared);
    auto* command = app.add_subcommand("update", "Ask a node to publish to all that are bound");
    request->add_options(*command);
    request->add_body_option(*command);
    command->footer("Examples:\n"
                    "  cles update car1:notice -d '{\"text\":\"bridge closed\"}'\n"
                    "  cles bind car1:notice          # in another terminal: sees it");
    command->callback([request, &shared] { shared.exit_code = request->run(); });
}

} // namespace tool
