// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/security/core_dumps.hpp>

#include "commands.hpp"
#include "output/errors.hpp"

#include <CLI/App.hpp>

#include <memory>
#include <utility>

namespace tool {

/// Has the command call `run` with its arguments, without core dumps. For commands that read private keys.
template <class Arguments, class F>
void run_with_keys(CLI::App& command, context& shared, std::shared_ptr<Arguments> args, F run) {
    command.callback([args = std::move(args), &shared, run] {
        cles::security::forbid_core_dumps();
        run(*args);
        shared.exit_code = exit_code::success;
    });
}

} // namespace tool
