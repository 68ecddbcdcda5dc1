// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace tool {

/// What a shell reads to complete `cles`: the files of apps/completion, which the build puts in.
struct completion_script {
    std::string_view shell;
    std::string_view text;
};

inline constexpr completion_script completion_scripts[] = {
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

} // namespace tool
