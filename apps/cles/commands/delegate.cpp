// SPDX-License-Identifier: BSL-1.0
#include "commands.hpp"
#include "commands/request_command.hpp"
#include "context.hpp"

#include <CLI/App.hpp>

#include <memory>

namespace tool {

void add_delegate(CLI::App& app, context& shared) {
    auto request = std::make_shared<request_command>(cles::verb::delegate, shared);
    auto* command = app.add_subcommand("delegate", "Have a task done and get its result");
    request->add_options(*command);
    request->add_urgent_option(*command);
    request->add_body_option(*command);
    request->add_progress_option(*command);
    command->footer("Ctrl-C withdraws the task.\n\n"
                    "Examples:\n"
                    "  cles delegate car1:sleep/3000\n"
                    "  cles delegate car1:echo -d '{\"samples\":[1,2,3]}' -t 1min");
    command->callback([request, &shared] { shared.exit_code = request->run(); });
}

} // namespace tool
