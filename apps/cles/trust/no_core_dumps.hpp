// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "commands.hpp"
#include "output/errors.hpp"

#include <CLI/App.hpp>

#include <memory>
#include <utility>

#include <sys/resource.h>

namespace tool {

/// While it exists, this process leaves no core dump, and other processes of the user cannot read its memory. For
/// commands that read private keys.
class no_core_dumps {
  public:
    /// \throws std::system_error
    no_core_dumps();
    no_core_dumps(const no_core_dumps&) = delete;
    no_core_dumps& operator=(const no_core_dumps&) = delete;
    ~no_core_dumps();

  private:
    rlimit limit_{};
    int dumpable_ = 0;
};

/// Has the command call `run` with its arguments, without core dumps. For commands that read private keys.
template <class Arguments, class F>
void run_with_keys(CLI::App& command, context& shared, std::shared_ptr<Arguments> args, F run) {
    command.callback([args = std::move(args), &shared, run] {
        const no_core_dumps guard;
        run(*args);
        shared.exit_code = exit_code::success;
    });
}

} // namespace tool
