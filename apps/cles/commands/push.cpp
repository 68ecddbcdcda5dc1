// SPDX-License-Identifier: BSL-1.0
#include "commands.hpp"
#include "commands/request_command.hpp"
#include "context.hpp"

#include <CLI/App.hpp>

#include <memory>

namespace tool {

void add_push(CLI::App& app, context& shared) {
    auto request = std::make_shared<request_command>(cles::verb::push, shared);
    auto* command = app.add_subcommand("push", "Send parameters and data");
    request->add_options(*command);
    request->add_urgent_option(*command);
    request->add_body_option(*command);
    command->footer("Examples:\n"
                    "  cles push car1:echo -d '{\"speed\":27.8}'\n"
                    "  cles push car1:echo -d @order.json\n"
                    "  jq -n '{speed:27.8}' | cles push car1:echo -d -");
    command->callback([request, &shared] { shared.exit_code = request->run(); });
}

} // namespace tool
