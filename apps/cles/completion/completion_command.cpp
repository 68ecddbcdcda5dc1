// SPDX-License-Identifier: BSL-1.0
#include "commands.hpp"
#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

#include <algorithm>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>

namespace tool {
namespace {

/// What a shell reads to complete `cles`: a file of apps/completion, which the build embeds.
struct completion_script {
    std::string_view shell;
    std::string_view text;
};

constexpr completion_script completion_scripts[] = {
    {
        "bash",
#include "cles.bash.inc"
    },
    {
        "zsh",
#include "_cles.inc"
    },
    {
        "fish",
#include "cles.fish.inc"
    },
};

} // namespace

void add_completion(CLI::App& app, context& shared) {
    auto shell = std::make_shared<std::string>();
    auto* command = app.add_subcommand("completion", "Print the completion script for a shell");
    command->add_option("shell", *shell, "bash, zsh or fish")
        ->required()
        ->type_name("")
        ->check(CLI::IsMember({"bash", "zsh", "fish"}).description(""));
    command->footer("An installation of cles includes the scripts. They ask nodes for their tasks while you type.\n\n"
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
