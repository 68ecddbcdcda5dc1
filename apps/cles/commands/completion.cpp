// SPDX-License-Identifier: BSL-1.0
#include "commands.hpp"
#include "commands/completion_scripts.hpp"
#include "context.hpp"
#include "output/output.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <algorithm>
#include <iterator>
#include <memory>
#include <string>

namespace tool {

void add_completion(CLI::App& app, context& shared) {
    auto shell = std::make_shared<std::string>();
    auto* command = app.add_subcommand("completion", "Print what a shell needs to complete nouns and options");
    command->add_option("shell", *shell, "bash, zsh or fish")
        ->required()
        ->type_name("")
        ->check(CLI::IsMember({"bash", "zsh", "fish"}).description(""));
    command->footer("An installed cles brings it along. Nodes and their tasks are asked for while you type.\n\n"
                    "Examples:\n"
                    "  source <(cles completion bash)                         # in ~/.bashrc\n"
                    "  source <(cles completion zsh)                          # in ~/.zshrc, after compinit\n"
                    "  cles completion fish > ~/.config/fish/completions/cles.fish");
    command->callback([shell, &shared] {
        const auto* const found = std::find_if(std::begin(completion_scripts), std::end(completion_scripts),
                                               [&](const completion_script& script) { return script.shell == *shell; });
        write_output(found->text);
        shared.exit_code = 0;
    });
}

} // namespace tool
