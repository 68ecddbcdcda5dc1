// SPDX-License-Identifier: BSL-1.0
#include "commands.hpp"
#include "commands/request_command.hpp"
#include "context.hpp"
#include "options/common_options.hpp"

#include <CLI/App.hpp>

#include <memory>

namespace tool {

void add_pull(CLI::App& app, context& shared) {
    auto request = std::make_shared<request_command>(cles::verb::pull, shared);
    auto* command = app.add_subcommand("pull", "Get data once");
    request->add_options(*command);
    request->add_urgent_option(*command);
    refuse_body(*command, "PULL");
    command->footer("Examples:\n"
                    "  cles pull car1:localization\n"
                    "  cles pull car1:localization --at tcp://10.0.0.7 -t 500ms\n"
                    "  cles pull car1:localization -n 10 -i 100ms -o json | jq .velocity\n"
                    "  cles pull self:cles --at unix:///run/car1.sock");
    command->callback([request, &shared] { shared.exit_code = request->run(); });
}

} // namespace tool
